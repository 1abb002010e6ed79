// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The residuals of inertial_residual.hpp as factors of a bundle_problem of inertial frames: what the IMU measured between
/// two frames, how far its biases walked meanwhile, and what is known of a state beforehand.
///
///     bundle_problem<Policy, inertial_frame, reprojections<camera>, frame_pair_factors<inertial_factor>,
///                    frame_pair_factors<bias_walk_factor>> problem(ctx);

#include <cmath>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "inertial_residual.hpp"
#include "preintegration.hpp"

namespace turbomap {

/// Nine residuals of rotation, velocity and position between a frame and the next one, whitened [Forster et al. 2017].
struct inertial_factor {
  static constexpr int size = 9;  ///< numbers of a residual: rotation, velocity, position
  /// Made by make_inertial_row().
  struct row {
    preintegration<double> motion;  ///< what the IMU measured from frame i to frame j
    double whitening[81];           ///< lower triangular, row-major: W^T W is the information
  };
  isometry<double> T_bc{{{1, 0, 0, 0, 1, 0, 0, 0, 1}}, {0, 0, 0}};  ///< camera to body, the frame of the IMU
  vec3<double> gravity{0, 0, -9.81};                                ///< in the world, m/s^2

  /// Writes the whitened residual, without unit; always defined. S: double or a dual number.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& i, const inertial_state<S>& j, const row& r, S* e) const {
    S raw[9];
    inertial_residual(r.motion, T_bc, i, j, cast<S>(gravity), raw);
    for (int k = 0; k < 9; ++k) {
      e[k] = S(0);
      for (int m = 0; m <= k; ++m) e[k] = e[k] + S(r.whitening[9 * k + m]) * raw[m];
    }
    return true;
  }
  /// The same with derivatives by the 15 unknowns of both states: 9 x 15 each, row by row.
  template <class = detail::this_target>
  TURBOMAP_HD bool linearise(const inertial_state<double>& i, const inertial_state<double>& j, const row& r, double* e,
                             double* d_i, double* d_j) const {
    double raw[9];
    inertial_jacobian J;
    linearise_inertial_residual(r.motion, T_bc, i, j, gravity, raw, J);
    for (int k = 0; k < 9; ++k) {
      double sum = 0, by_i[15] = {}, by_j[15] = {};  // a device keeps them in registers
      for (int m = 0; m <= k; ++m) {
        const double w = r.whitening[9 * k + m];
        sum += w * raw[m];
        for (int c = 0; c < 15; ++c) by_i[c] += w * J.i[15 * m + c], by_j[c] += w * J.j[15 * m + c];
      }
      e[k] = sum;
      for (int c = 0; c < 15; ++c) d_i[15 * k + c] = by_i[c], d_j[15 * k + c] = by_j[c];
    }
    return true;
  }
};

/// Six residuals of how far the biases of gyroscope and accelerometer walked between two frames.
struct bias_walk_factor {
  static constexpr int size = 6;  ///< numbers of a residual: gyroscope, accelerometer
  /// Made by make_walk_row().
  struct row {
    double gyro;          ///< 1 / sigma of the walk of each element, s/rad
    double acceleration;  ///< in the same way, s^2/m
  };

  /// Writes the whitened residual, without unit; always defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& i, const inertial_state<S>& j, const row& r, S* e) const {
    S raw[6];
    bias_walk_residual(i.bias, j.bias, raw);
    for (int k = 0; k < 6; ++k) e[k] = S(k < 3 ? r.gyro : r.acceleration) * raw[k];
    return true;
  }
  /// The same with derivatives by the 15 unknowns of both states: 6 x 15 each, row by row.
  template <class = detail::this_target>
  TURBOMAP_HD bool linearise(const inertial_state<double>& i, const inertial_state<double>& j, const row& r, double* e,
                             double* d_i, double* d_j) const {
    residual(i, j, r, e);
    for (int k = 0; k < 6 * 15; ++k) d_i[k] = d_j[k] = 0;
    for (int k = 0; k < 6; ++k) {
      const double w = k < 3 ? r.gyro : r.acceleration;
      d_i[15 * k + 9 + k] = -w, d_j[15 * k + 9 + k] = w;
    }
    return true;
  }
};

/// What is known of velocity and biases beforehand, e.g. of a frame at rest, or of an IMU that was calibrated: nine residuals,
/// velocity, gyroscope, accelerometer.
struct inertial_prior_factor {
  static constexpr int size = 9;  ///< numbers of a residual: velocity, gyroscope, accelerometer
  /// What is known of one state.
  struct row {
    vec3<double> velocity;       ///< m/s
    imu_bias<double> bias;       ///< rad/s, m/s^2
    double velocity_weight;      ///< 1 / sigma of each element, s/m; 0: nothing is known
    double gyro_weight;          ///< in the same way, s/rad
    double acceleration_weight;  ///< in the same way, s^2/m
  };

  /// Writes the whitened residual, without unit; always defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& x, const row& r, S* e) const {
    const vec3<S>* const now[3] = {&x.velocity, &x.bias.gyro, &x.bias.acceleration};
    const vec3<double>* const known[3] = {&r.velocity, &r.bias.gyro, &r.bias.acceleration};
    const double weight[3] = {r.velocity_weight, r.gyro_weight, r.acceleration_weight};
    for (int k = 0; k < 3; ++k) {
      const S w(weight[k]);
      e[3 * k] = w * (now[k]->x - S(known[k]->x)), e[3 * k + 1] = w * (now[k]->y - S(known[k]->y));
      e[3 * k + 2] = w * (now[k]->z - S(known[k]->z));
    }
    return true;
  }
  /// The same with derivatives by the 15 unknowns of the state: 9 x 15, row by row.
  template <class = detail::this_target>
  TURBOMAP_HD bool linearise(const inertial_state<double>& x, const row& r, double* e, double* d) const {
    residual(x, r, e);
    for (int k = 0; k < 9 * 15; ++k) d[k] = 0;
    for (int k = 0; k < 9; ++k)
      d[15 * k + 6 + k] = k < 3 ? r.velocity_weight : k < 6 ? r.gyro_weight : r.acceleration_weight;
    return true;
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// \param weight  of its information: 1, or e.g. 1e-2 for the oldest edge of a window, whose start is not to be believed
///                [ORB-SLAM3]
/// \return false: the covariance has no inverse (one step of the sensor, no noise), or the weight is not finite and positive
inline bool make_inertial_row(const preintegration<double>& motion, double weight, inertial_factor::row& row) {
  if (!(weight > 0) || !detail::is_finite(weight) || !inertial_whitening(motion, row.whitening)) return false;
  row.motion = motion;
  const double root = std::sqrt(weight);
  for (double& w : row.whitening) w *= root;
  return true;
}

/// Of biases that do not walk, or less than 1e-6 (rad/s, m/s^2) / sqrt(s), it says that they walk so much: a factor cannot say that
/// two are one unknown, and one of far more weight than all others holds them where they begin.
/// \return false: the motion has no duration
inline bool make_walk_row(const preintegration<double>& motion, bias_walk_factor::row& row) {
  const double least = 1e-12 * motion.dt;
  if (!(least > 0)) return false;
  const auto weight = [least](double variance) { return 1 / std::sqrt(variance > least ? variance : least); };
  row.gyro = weight(motion.gyro_walk), row.acceleration = weight(motion.acceleration_walk);
  return true;
}

TURBOMAP_END_NAMESPACE
