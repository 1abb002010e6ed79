// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// By how much the states of two frames contradict what the IMU measured in between: nine residuals of rotation,
/// velocity and position [Forster et al. 2017, eq. 45], and six of how far the biases walked; with their derivatives.
/// What a solver of visual-inertial problems minimises beside the reprojection errors.
///
/// Poses are T_cw, those of the visual residuals; T_bc takes them to the body. With (B, t) = T_bc T_cw:
///     r_R = Log(dR^T B_i B_j^T)
///     r_V = B_i (v_j - v_i - g dt) - dV
///     r_P = t_i - B_i B_j^T t_j - B_i (v_i dt + g dt^2 / 2) - dP
/// where dR, dV, dP are corrected to the bias of i.

#include "../adjustment/small_cholesky.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "bias_update.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Residuals: rotation (rad), velocity (m/s) and position (m), in the body frame of i.
/// \tparam S  double, or a dual number: the preintegration and T_bc are constants
template <class S>
TURBOMAP_HD void inertial_residual(const preintegration<double>& p, const isometry<double>& T_bc,
                                   const inertial_state<S>& i, const inertial_state<S>& j, const vec3<S>& gravity,
                                   S (&r)[9]) {
  const isometry<S> T{cast<S>(T_bc.R), cast<S>(T_bc.t)};
  const isometry<S> Ti = T * to_isometry<S>(i.T_cw), Tj = T * to_isometry<S>(j.T_cw);
  const relative_motion<S> m = corrected(p, i.bias);
  const S dt(p.dt);
  const mat3<S> B_ij = Ti.R * transpose(Tj.R);
  const vec3<S> r_R = rotation_log(transpose(m.dR) * B_ij);
  const vec3<S> r_V = Ti.R * (j.velocity - i.velocity - dt * gravity) - m.dV;
  const vec3<S> r_P = Ti.t - B_ij * Tj.t - Ti.R * (dt * i.velocity + (S(0.5) * dt * dt) * gravity) - m.dP;
  const vec3<S>* const parts[3] = {&r_R, &r_V, &r_P};
  for (int k = 0; k < 3; ++k) r[3 * k] = parts[k]->x, r[3 * k + 1] = parts[k]->y, r[3 * k + 2] = parts[k]->z;
}

/// Two directions at right angles to gravity and to each other, of unit length: its direction has two unknowns, a turn
/// about each of them.
TURBOMAP_HD inline void gravity_basis(const vec3<double>& gravity, vec3<double> (&basis)[2]) {
  const double x = gravity.x * gravity.x, y = gravity.y * gravity.y, z = gravity.z * gravity.z;
  const vec3<double> aside = x <= y && x <= z ? vec3<double>{1, 0, 0}
                             : y <= z         ? vec3<double>{0, 1, 0}
                                              : vec3<double>{0, 0, 1};
  const vec3<double> first = cross(gravity, aside);
  basis[0] = (1 / norm(first)) * first;
  const vec3<double> second = cross(gravity, basis[0]);
  basis[1] = (1 / norm(second)) * second;
}
/// Gravity after a turn by step[0] and step[1] (rad) about its basis.
template <class S>
TURBOMAP_HD vec3<S> turn_gravity(const vec3<double>& gravity, const S* step) {
  vec3<double> basis[2];
  gravity_basis(gravity, basis);
  return rotation_exp(step[0] * cast<S>(basis[0]) + step[1] * cast<S>(basis[1])) * cast<S>(gravity);
}

/// The state after a step of its 15 unknowns.
template <class S>
TURBOMAP_HD inertial_state<S> move_state(const S* step, const inertial_state<double>& state) {
  const auto add = [](const vec3<double>& a, const S* d) {
    return vec3<S>{S(a.x) + d[0], S(a.y) + d[1], S(a.z) + d[2]};
  };
  inertial_state<S> moved;
  moved.T_cw = left_exp(step, state.T_cw);
  moved.velocity = add(state.velocity, step + 6);
  moved.bias = {add(state.bias.gyro, step + 9), add(state.bias.acceleration, step + 12)};
  return moved;
}

/// Derivatives of the nine residuals, row-major.
struct inertial_jacobian {
  double i[9 * 15];       ///< by the unknowns of the first state
  double j[9 * 15];       ///< by those of the second
  double gravity[9 * 2];  ///< by turns about gravity_basis()
};

namespace detail {

/// Writes a 3x3 block at (row, column) of a matrix of so many columns.
TURBOMAP_HD inline void put_block(double* to, int columns, int row, int column, const mat3<double>& block) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) to[(row + r) * columns + column + c] = block(r, c);
}

/// Derivatives by a step of the frame's pose, from those by a step of the body's: exp(omega, v) of the frame is that of
/// (R omega, R v + [t]x R omega) of the body, T_bc = (R, t).
TURBOMAP_HD inline void put_pose(double* to, int row, const isometry<double>& T_bc, const mat3<double>& by_rotation,
                                 const mat3<double>& by_translation) {
  put_block(to, 15, row, 0, (by_rotation + by_translation * skew(T_bc.t)) * T_bc.R);
  put_block(to, 15, row, 3, by_translation * T_bc.R);
}

}  // namespace detail

/// The residuals and their derivatives.
TURBOMAP_HD inline void linearise_inertial_residual(const preintegration<double>& p, const isometry<double>& T_bc,
                                                    const inertial_state<double>& i, const inertial_state<double>& j,
                                                    const vec3<double>& gravity, double (&r)[9], inertial_jacobian& J) {
  inertial_residual(p, T_bc, i, j, gravity, r);
  const isometry<double> Ti = T_bc * to_isometry<double>(i.T_cw), Tj = T_bc * to_isometry<double>(j.T_cw);
  const mat3<double> B = Ti.R, B_ij = B * transpose(Tj.R), none{};
  const relative_motion<double> m = corrected(p, i.bias);
  const double dt = p.dt, half = 0.5 * dt * dt;
  for (double& x : J.i) x = 0;
  for (double& x : J.j) x = 0;

  const mat3<double> inverse_right = right_jacobian_inverse(vec3<double>{r[0], r[1], r[2]});
  const mat3<double> E = transpose(m.dR) * B_ij;  // Exp(r_R)
  const rotation_jacobian<double> turned(p.J_Rg * (i.bias.gyro - p.bias.gyro));
  detail::put_pose(J.i, 0, T_bc, inverse_right * transpose(B_ij), none);
  detail::put_block(J.i, 15, 0, 9, -1.0 * (inverse_right * transpose(E) * turned.right * p.J_Rg));
  detail::put_pose(J.j, 0, T_bc, -1.0 * inverse_right, none);

  const vec3<double> V{r[3] + m.dV.x, r[4] + m.dV.y, r[5] + m.dV.z}, P{r[6] + m.dP.x, r[7] + m.dP.y, r[8] + m.dP.z};
  detail::put_pose(J.i, 3, T_bc, skew(-1.0 * V), none);
  detail::put_block(J.i, 15, 3, 6, -1.0 * B);
  detail::put_block(J.i, 15, 3, 9, -1.0 * p.J_Vg);
  detail::put_block(J.i, 15, 3, 12, -1.0 * p.J_Va);
  detail::put_block(J.j, 15, 3, 6, B);

  detail::put_pose(J.i, 6, T_bc, skew(-1.0 * P), identity3<double>());
  detail::put_block(J.i, 15, 6, 6, -dt * B);
  detail::put_block(J.i, 15, 6, 9, -1.0 * p.J_Pg);
  detail::put_block(J.i, 15, 6, 12, -1.0 * p.J_Pa);
  detail::put_pose(J.j, 6, T_bc, none, -1.0 * B_ij);

  vec3<double> basis[2];
  gravity_basis(gravity, basis);
  for (int k = 0; k < 2; ++k) {
    const vec3<double> d = B * cross(basis[k], gravity);
    const double by[9] = {0, 0, 0, -dt * d.x, -dt * d.y, -dt * d.z, -half * d.x, -half * d.y, -half * d.z};
    for (int row = 0; row < 9; ++row) J.gravity[2 * row + k] = by[row];
  }
}

/// W with W r of unit covariance, lower triangular, row-major: the information of the residuals is W^T W.
/// \return false: the covariance has no inverse (an interval of one step, or noise 0); W is then not written
TURBOMAP_HD inline bool inertial_whitening(const preintegration<double>& p, double (&W)[81]) {
  double L[81];
  for (int r = 0; r < 9; ++r)
    for (int c = 0; c < 9; ++c) L[9 * r + c] = p.covariance(r, c);
  double diagonal[9];
  for (int k = 0; k < 9; ++k) diagonal[k] = L[10 * k];
  constexpr double singular = 1e-12;  // of a pivot: rounding of the sums that made the covariance
  if (!factorise_small<9>(L, diagonal, singular)) return false;
  for (int c = 0; c < 9; ++c) {
    double x[9] = {};
    x[c] = 1;
    solve_lower<9>(L, x);
    for (int r = 0; r < 9; ++r) W[9 * r + c] = x[r];
  }
  return true;
}

/// How far the biases walked from i to j: gyroscope (rad/s), accelerometer (m/s^2). The derivative by the biases of j
/// is the identity, by those of i its negative; the variances are p.gyro_walk and p.acceleration_walk.
template <class S>
TURBOMAP_HD void bias_walk_residual(const imu_bias<S>& i, const imu_bias<S>& j, S (&r)[6]) {
  const vec3<S> g = j.gyro - i.gyro, a = j.acceleration - i.acceleration;
  r[0] = g.x, r[1] = g.y, r[2] = g.z, r[3] = a.x, r[4] = a.y, r[5] = a.z;
}

TURBOMAP_END_NAMESPACE
