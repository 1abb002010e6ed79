// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A preintegration sums up what an IMU measured between two frames: by how much it turned, sped up and moved, as seen
/// from the first frame and without gravity. It does not depend on the pose or the velocity at the start, so it is
/// computed once; when the estimate of the bias changes, its derivatives correct it
/// [Forster et al., On-manifold preintegration for real-time visual-inertial odometry, IEEE T-RO 2017].

#include <initializer_list>
#include <type_traits>

#include "../config.hpp"
#include "../types.hpp"
#include "imu_samples.hpp"

namespace turbomap {

/// Motion of the body from frame i to frame j, in the frame of i. With R_i, v_i, p_i orientation (body to world),
/// velocity and position, and gravity g:
///     R_j = R_i dR,   v_j = v_i + g dt + R_i dV,   p_j = p_i + v_i dt + g dt^2 / 2 + R_i dP
/// Errors and derivatives: dR is off by Exp(r) on its right; dV and dP by sums. Default: no time has passed.
template <class S>
struct preintegration {
  S dt{0};           ///< s
  imu_bias<S> bias;  ///< at which it was integrated
  /// Rotation from the second body frame to the first.
  mat3<S> dR{{S(1), S(0), S(0), S(0), S(1), S(0), S(0), S(0), S(1)}};
  vec3<S> dV{S(0), S(0), S(0)};  ///< m/s
  vec3<S> dP{S(0), S(0), S(0)};  ///< m

  /// \name Derivatives of rotation, velocity and position by the biases of gyroscope (g) and accelerometer (a)
  /// @{

  /// Of dR, dV, dP (first letter) by the bias of g or a.
  mat3<S> J_Rg{}, J_Vg{}, J_Va{}, J_Pg{}, J_Pa{};
  /// @}
  /// \name Covariance of (rotation r in rad, velocity in m/s, position in m) by blocks, the lower half
  /// @{

  /// Covariance of the first letter's part with the second's.
  mat3<S> C_RR{}, C_VR{}, C_VV{}, C_PR{}, C_PV{}, C_PP{};
  /// @}
  S gyro_walk{0};          ///< variance by which each element of the gyroscope's bias walks meanwhile, (rad/s)^2
  S acceleration_walk{0};  ///< in the same way of the accelerometer's, (m/s^2)^2

  /// The covariance as one symmetric 15x15 matrix: rotation, velocity, position, walk of the gyroscope's bias, of the
  /// accelerometer's.
  TURBOMAP_HD S covariance(int row, int column) const {
    if (row < column) return covariance(column, row);
    if (row >= 9) return row != column ? S(0) : row < 12 ? gyro_walk : acceleration_walk;
    const mat3<S>* lower[6] = {&C_RR, &C_VR, &C_VV, &C_PR, &C_PV, &C_PP};
    const int r = row / 3, c = column / 3;
    return (*lower[r * (r + 1) / 2 + c])(row % 3, column % 3);
  }
};

static_assert(std::is_trivially_copyable_v<preintegration<double>>);

/// What a frame of a visual-inertial problem knows about itself. Its unknowns are 15, in this order: a step (omega, v)
/// of the pose, exp(omega, v) T_cw as left_exp() has it; velocity; bias of the gyroscope; bias of the accelerometer.
template <class S>
struct inertial_state {
  rigid_transform<S> T_cw;  ///< world to the frame in which visual residuals are, e.g. that of the left camera
  vec3<S> velocity{S(0), S(0), S(0)};  ///< of the IMU in the world, m/s
  imu_bias<S> bias;                    ///< rad/s, m/s^2
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE
namespace detail {
/// Of all that it holds but dt: not finite where one of them is not.
template <class S>
S sum_of_elements(const preintegration<S>& p) {
  S sum = p.gyro_walk + p.acceleration_walk;
  for (const vec3<S>* v : {&p.bias.gyro, &p.bias.acceleration, &p.dV, &p.dP}) sum += v->x + v->y + v->z;
  for (const mat3<S>* m :
       {&p.dR, &p.J_Rg, &p.J_Vg, &p.J_Va, &p.J_Pg, &p.J_Pa, &p.C_RR, &p.C_VR, &p.C_VV, &p.C_PR, &p.C_PV, &p.C_PP})
    for (const S x : m->m) sum += x;
  return sum;
}
}  // namespace detail
TURBOMAP_END_NAMESPACE
