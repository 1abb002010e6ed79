// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Ratios of distances of descriptors: of Euclidean ones of real descriptors, whose distance() is the square.

#include <turbomap/descriptor/real.hpp>

#include <cmath>

#include "two_views.hpp"

namespace turbomap_test {

template <class Descriptor>
inline constexpr bool is_real = false;
template <class Storage, int Length>
inline constexpr bool is_real<turbomap::real_descriptor<Storage, Length>> = true;

/// 1: a distance is above `ratio` of another, -1: below, 0: equal. Compared, not subtracted: a fused multiplication and
/// subtraction finds 19 above 0.95 of 20.
/// \param distance  what Descriptor::distance() gave; so is `other`
template <class Descriptor>
int above_ratio(double distance, double ratio, double other, close_calls& calls) {
  if (is_real<Descriptor>) distance = std::sqrt(distance), other = std::sqrt(other);
  const double limit = ratio * other;
  if (is_real<Descriptor>) calls.less(distance, limit);
  return (distance > limit ? 1 : 0) - (distance < limit ? 1 : 0);
}

}  // namespace turbomap_test
