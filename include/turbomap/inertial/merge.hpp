// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Preintegrations one after the other: of a then b, the motion from the start of a to the end of b. Integration itself
/// is merging with one step of the sensor; so merging what two intervals gave is the same as integrating both at once.
/// Also what is done when the keyframe between them is culled.

#include "../config.hpp"
#include "../math/linear.hpp"
#include "bias_update.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One step of Newton's iteration towards the nearest rotation: a product of many rotations drifts, in float soon.
template <class S>
TURBOMAP_HD mat3<S> orthonormalised(const mat3<S>& R) {
  const mat3<S> G = transpose(R) * R;
  mat3<S> half = S(-0.5) * G;
  for (int i = 0; i < 3; ++i) half(i, i) = half(i, i) + S(1.5);
  return R * half;
}

/// merge() where both have the same bias.
template <class S>
TURBOMAP_HD preintegration<S> append(const preintegration<S>& a, const preintegration<S>& b) {
  preintegration<S> m;
  m.bias = a.bias, m.dt = a.dt + b.dt;
  m.dR = orthonormalised(a.dR * b.dR);
  m.dV = a.dV + a.dR * b.dV;
  m.dP = a.dP + b.dt * a.dV + a.dR * b.dP;

  // How an error r of a's rotation goes on: into the rotation by F, the velocity by G, the position by K.
  const mat3<S> F = transpose(b.dR), Ft = b.dR, Rt = transpose(a.dR);
  const mat3<S> G = a.dR * skew(S(-1) * b.dV), K = a.dR * skew(S(-1) * b.dP);
  const mat3<S> Gt = transpose(G), Kt = transpose(K);
  const S& t = b.dt;
  m.J_Rg = F * a.J_Rg + b.J_Rg;
  m.J_Vg = a.J_Vg + a.dR * b.J_Vg + G * a.J_Rg;
  m.J_Va = a.J_Va + a.dR * b.J_Va;
  m.J_Pg = a.J_Pg + t * a.J_Vg + a.dR * b.J_Pg + K * a.J_Rg;
  m.J_Pa = a.J_Pa + t * a.J_Va + a.dR * b.J_Pa;

  const mat3<S> VRF = a.C_VR + G * a.C_RR, PRF = a.C_PR + t * a.C_VR + K * a.C_RR;  // by a's rotation
  const mat3<S> C_RV = transpose(a.C_VR), C_VP = transpose(a.C_PV);
  const mat3<S> VV = a.C_VV + G * C_RV, PV = a.C_PV + t * a.C_VV + K * C_RV;  // by a's velocity
  const mat3<S> PP = a.C_PP + t * C_VP + K * transpose(a.C_PR);               // by a's position
  m.C_RR = F * a.C_RR * Ft + b.C_RR;
  m.C_VR = VRF * Ft + a.dR * b.C_VR;
  m.C_PR = PRF * Ft + a.dR * b.C_PR;
  m.C_VV = VV + VRF * Gt + a.dR * b.C_VV * Rt;
  m.C_PV = PV + PRF * Gt + a.dR * b.C_PV * Rt;
  m.C_PP = PP + t * PV + PRF * Kt + a.dR * b.C_PP * Rt;
  m.gyro_walk = a.gyro_walk + b.gyro_walk;
  m.acceleration_walk = a.acceleration_walk + b.acceleration_walk;
  return m;
}

}  // namespace detail

/// The motion of `a` and then of `b`, which begins where a ends. Where they were integrated at different biases, b is
/// taken to that of a first, to first order. Where they meet at a sample, the same result as integrating all samples at once,
/// within rounding; between two samples, where both interpolate, noise and mean differ a little. O(1).
template <class S>
TURBOMAP_HD preintegration<S> merge(const preintegration<S>& a, const preintegration<S>& b) {
  return same_bias(a.bias, b.bias) ? detail::append(a, b) : detail::append(a, rebased(b, a.bias));
}

TURBOMAP_END_NAMESPACE
