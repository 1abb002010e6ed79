// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How far two lists of inertial states are apart, in all of their numbers.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <turbomap/inertial/inertial_residual.hpp>

#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

/// The largest difference of a number of two states: elements of the quaternion, m, m/s, rad/s, m/s^2; beyond 1 of
/// these units relative to the number in b. NaN where a result holds one.
/// The largest difference of two numbers in the same place, relative beyond 1. NaN where a list holds one.
inline double distance(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double d = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    d = larger_or_nan(d, std::abs(a[i] - b[i]) / std::max(1.0, std::abs(b[i])));
  return d;
}

inline std::vector<double> numbers_of(const std::vector<turbomap::inertial_state<double>>& states) {
  std::vector<double> all;
  for (const auto& s : states) {
    const auto& T = s.T_cw;
    all.insert(all.end(), {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz});
    for (const auto& v : {s.velocity, s.bias.gyro, s.bias.acceleration}) all.insert(all.end(), {v.x, v.y, v.z});
  }
  return all;
}
inline double distance(const std::vector<turbomap::inertial_state<double>>& a,
                       const std::vector<turbomap::inertial_state<double>>& b) {
  return distance(numbers_of(a), numbers_of(b));
}

}  // namespace turbomap_test
