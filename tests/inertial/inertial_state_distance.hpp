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

#include "support/larger_or_nan.hpp"

namespace turbomap_test {

/// The largest difference of a number of two states: elements of the quaternion, m, m/s, rad/s, m/s^2; beyond 1 of
/// these units relative to the number in b. NaN where a result holds one.
inline double distance(const std::vector<turbomap::inertial_state<double>>& a,
                       const std::vector<turbomap::inertial_state<double>>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double d = 0;
  const auto compare = [&d](double x, double y) { d = larger_or_nan(d, std::abs(x - y) / std::max(1.0, std::abs(y))); };
  const auto compare_vectors = [&](const turbomap::vec3<double>& x, const turbomap::vec3<double>& y) {
    compare(x.x, y.x), compare(x.y, y.y), compare(x.z, y.z);
  };
  for (std::size_t f = 0; f < a.size(); ++f) {
    const auto &T = a[f].T_cw, &U = b[f].T_cw;
    compare(T.qx, U.qx), compare(T.qy, U.qy), compare(T.qz, U.qz), compare(T.qw, U.qw);
    compare(T.tx, U.tx), compare(T.ty, U.ty), compare(T.tz, U.tz);
    compare_vectors(a[f].velocity, b[f].velocity), compare_vectors(a[f].bias.gyro, b[f].bias.gyro);
    compare_vectors(a[f].bias.acceleration, b[f].bias.acceleration);
  }
  return d;
}

}  // namespace turbomap_test
