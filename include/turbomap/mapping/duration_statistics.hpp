// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Mean and quantiles of durations.

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "../plain_vector.hpp"

namespace turbomap {

/// Times of one stage over many keyframes.
class duration_statistics {
 public:
  /// Amortised O(1).
  void add(double ms) { samples_.push_back(ms); }
  /// How many were added.
  std::size_t count() const { return samples_.size(); }
  /// 0 without samples.
  double mean() const {
    double sum = 0;
    for (const double t : samples_) sum += t;
    return samples_.empty() ? 0 : sum / static_cast<double>(samples_.size());
  }
  /// Element floor(q (n - 1)) of the sorted samples: 0.5 the median, 0.95, 1 the largest. 0 without samples. O(n).
  double quantile(double q) const {
    if (samples_.empty()) return 0;
    plain_vector<double> copy = samples_;
    const auto at = copy.begin() + static_cast<std::ptrdiff_t>(std::floor(q * static_cast<double>(copy.size() - 1)));
    std::nth_element(copy.begin(), at, copy.end());
    return *at;
  }
  /// All, in the order in which they were added.
  const plain_vector<double>& samples() const { return samples_; }

 private:
  plain_vector<double> samples_;
};

}  // namespace turbomap
