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

/// By how much a distance is above `ratio` of another.
/// \param distance  what Descriptor::distance() gave; so is `other`
template <class Descriptor>
double above_ratio(double distance, double ratio, double other, close_calls& calls) {
  if (!is_real<Descriptor>) return distance - ratio * other;
  distance = std::sqrt(distance), other = ratio * std::sqrt(other);
  calls.less(distance, other);
  return distance - other;
}

}  // namespace turbomap_test
