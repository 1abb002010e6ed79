// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Factors as a user writes them, of all three kinds; derivatives by dual numbers.

#include <turbomap/math/linear.hpp>
#include <turbomap/types.hpp>

namespace turbomap_test {

/// The direction of a landmark on the plane z = 1.
struct bearing_factor {
  static constexpr int size = 2;
  struct row {
    double x, y;
  };
  double weight;
  template <class S>
  TURBOMAP_HD bool residual(const turbomap::rigid_transform<S>& T_cw, const turbomap::vec3<S>& landmark, const row& r,
                            S* e) const {
    const turbomap::vec3<S> p = turbomap::to_isometry<S>(T_cw) * landmark;
    if (p.z == S(0)) return false;
    e[0] = S(weight) * (p.x / p.z - S(r.x)), e[1] = S(weight) * (p.y / p.z - S(r.y));
    return true;
  }
};

/// A pose that is known: its translation, and three elements of its rotation.
struct prior_factor {
  static constexpr int size = 6;
  struct row {
    turbomap::rigid_transform<double> T_cw;
  };
  double weight;
  template <class S>
  TURBOMAP_HD bool residual(const turbomap::rigid_transform<S>& T_cw, const row& r, S* e) const {
    const auto a = turbomap::to_isometry<S>(T_cw), b = turbomap::to_isometry<S>(r.T_cw);
    e[0] = a.t.x - b.t.x, e[1] = a.t.y - b.t.y, e[2] = a.t.z - b.t.z;
    e[3] = a.R(2, 1) - b.R(2, 1), e[4] = a.R(0, 2) - b.R(0, 2), e[5] = a.R(1, 0) - b.R(1, 0);
    for (int i = 0; i < 6; ++i) e[i] = S(weight) * e[i];
    return true;
  }
};

/// The second translation less half the first, turned back by the first rotation: not symmetric in its frames.
struct odometry_factor {
  static constexpr int size = 3;
  struct row {
    turbomap::vec3<double> shift;
  };
  double weight;
  template <class S>
  TURBOMAP_HD bool residual(const turbomap::rigid_transform<S>& first, const turbomap::rigid_transform<S>& second,
                            const row& r, S* e) const {
    using turbomap::operator-;
    using turbomap::operator*;
    const auto a = turbomap::to_isometry<S>(first), b = turbomap::to_isometry<S>(second);
    const turbomap::vec3<S> d = turbomap::transpose(a.R) * (b.t - S(0.5) * a.t);
    e[0] = S(weight) * (d.x - S(r.shift.x)), e[1] = S(weight) * (d.y - S(r.shift.y));
    e[2] = S(weight) * (d.z - S(r.shift.z));
    return true;
  }
};

}  // namespace turbomap_test
