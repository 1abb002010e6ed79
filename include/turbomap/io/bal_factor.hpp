// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// BAL problems as bundle adjustments: the state of a camera, and its factor with analytic derivatives.

#include "../adjustment/frames.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "bal.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A BAL camera as a frame of nine unknowns, and back. Rotation vectors come back with angles of at most half a turn.
inline self_calibrated_state<double> bal_state(const bal_camera& camera) {
  return {bal_pose(camera), camera.f, camera.k1, camera.k2};
}
/// The camera of a state, its rotation as a vector of at most half a turn.
inline bal_camera bal_camera_of(const self_calibrated_state<double>& x) {
  const rigid_transform<double>& T = x.T_cw;
  const double n = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz), sign = T.qw < 0 ? -1 : 1;
  const double s = n > 0 ? sign * 2 * std::atan2(n, sign * T.qw) / n : 2 * sign;
  return {{s * T.qx, s * T.qy, s * T.qz}, {T.tx, T.ty, T.tz}, x.f, x.k1, x.k2};
}

/// Reprojection in a camera with its own lens (bal.hpp has the formula), sigma 1 px. Defined everywhere but in the
/// focal plane.
struct bal_reprojection {
  static constexpr int size = 2;  ///< numbers of a residual: u, v
  using row = vec2<double>;       ///< the measured pixel

  /// The projection less the measurement, px; false in the focal plane.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool residual(const self_calibrated_state<S>& x, const vec3<S>& landmark, const row& measured,
                            S* e) const {
    const vec3<S> P = to_isometry<S>(x.T_cw) * landmark;
    if (P.z == S(0)) return false;
    const S px = -P.x / P.z, py = -P.y / P.z, r2 = px * px + py * py;
    const S s = x.f * (S(1) + r2 * (x.k1 + x.k2 * r2));
    e[0] = s * px - S(measured.x), e[1] = s * py - S(measured.y);
    return true;
  }

  /// The same with derivatives: 2 x 9 by the frame's unknowns, 2 x 3 by the landmark, row by row.
  TURBOMAP_HD bool linearise(const self_calibrated_state<double>& x, const vec3<double>& landmark, const row& measured,
                             double* e, double* d_frame, double* d_landmark) const {
    const isometry<double> T = to_isometry<double>(x.T_cw);
    const vec3<double> P = T * landmark;
    if (P.z == 0) return false;
    const double iz = 1 / P.z, p[2] = {-P.x * iz, -P.y * iz}, r2 = p[0] * p[0] + p[1] * p[1];
    const double s = 1 + r2 * (x.k1 + x.k2 * r2), slope = 2 * x.k1 + 4 * x.k2 * r2;
    const double measurement[2] = {measured.x, measured.y};
    for (int i = 0; i < 2; ++i) {
      e[i] = x.f * s * p[i] - measurement[i];
      const double by_x = x.f * (slope * p[i] * p[0] + (i == 0 ? s : 0)),
                   by_y = x.f * (slope * p[i] * p[1] + (i == 1 ? s : 0));
      const vec3<double> g{-by_x * iz, -by_y * iz, -(by_x * p[0] + by_y * p[1]) * iz};  // of e[i] by P
      double* f = d_frame + 9 * i;
      f[0] = P.y * g.z - P.z * g.y, f[1] = P.z * g.x - P.x * g.z, f[2] = P.x * g.y - P.y * g.x;
      f[3] = g.x, f[4] = g.y, f[5] = g.z;
      f[6] = s * p[i], f[7] = x.f * r2 * p[i], f[8] = x.f * r2 * r2 * p[i];
      const vec3<double> by_landmark = transpose(T.R) * g;
      d_landmark[3 * i] = by_landmark.x, d_landmark[3 * i + 1] = by_landmark.y, d_landmark[3 * i + 2] = by_landmark.z;
    }
    return true;
  }
};

TURBOMAP_END_NAMESPACE
