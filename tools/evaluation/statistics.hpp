// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What evaluations print: quantiles, and counts as shares.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace turbomap::evaluation {

/// The value below which a share `q` of the samples lies; NaN without samples.
inline double quantile(std::vector<double> samples, double q) {
  if (samples.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = std::min(samples.size() - 1, static_cast<std::size_t>(q * static_cast<double>(samples.size())));
  std::nth_element(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(at), samples.end());
  return samples[at];
}
inline double median(const std::vector<double>& samples) { return quantile(samples, 0.5); }

/// part / whole; 0 of nothing is 0.
inline double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace turbomap::evaluation
