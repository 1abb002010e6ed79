// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A preintegration at another bias than that of its integration: corrected by its derivatives, which is right to first
/// order [Forster et al. 2017, eq. 44]; and the rule of when that is not enough.

#include <cmath>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "preintegration.hpp"
#include "preintegration_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether two biases are equal to the last bit.
template <class S>
TURBOMAP_HD bool same_bias(const imu_bias<S>& a, const imu_bias<S>& b) {
  const auto same = [](const vec3<S>& x, const vec3<S>& y) { return x.x == y.x && x.y == y.y && x.z == y.z; };
  return same(a.gyro, b.gyro) && same(a.acceleration, b.acceleration);
}

/// Rotation, velocity and position of a preintegration.
template <class S>
struct relative_motion {
  mat3<S> dR;  ///< rotation, as preintegration::dR
  vec3<S> dV;  ///< velocity, m/s
  vec3<S> dP;  ///< position, m
};

/// What `p` would be at `bias`, to first order. T may be a dual number while p holds doubles.
template <class S, class T>
TURBOMAP_HD relative_motion<T> corrected(const preintegration<S>& p, const imu_bias<T>& bias) {
  const vec3<T> g = bias.gyro - cast<T>(p.bias.gyro), a = bias.acceleration - cast<T>(p.bias.acceleration);
  relative_motion<T> m;
  m.dR = cast<T>(p.dR) * rotation_exp(cast<T>(p.J_Rg) * g);
  m.dV = cast<T>(p.dV) + cast<T>(p.J_Vg) * g + cast<T>(p.J_Va) * a;
  m.dP = cast<T>(p.dP) + cast<T>(p.J_Pg) * g + cast<T>(p.J_Pa) * a;
  return m;
}

/// The preintegration at `bias`, to first order; derivatives and covariance stay those of the integration.
template <class S>
TURBOMAP_HD preintegration<S> rebased(const preintegration<S>& p, const imu_bias<S>& bias) {
  const relative_motion<S> m = corrected(p, bias);
  preintegration<S> r = p;
  r.bias = bias, r.dR = m.dR, r.dV = m.dV, r.dP = m.dP;
  return r;
}

/// Whether `bias` is so far from that of the integration that the samples should be integrated again.
template <class S>
TURBOMAP_HD bool needs_integration(const preintegration<S>& p, const imu_bias<S>& bias,
                                   const preintegration_options& options) {
  const S longer = p.dt > S(1) ? p.dt : S(1);  // s
  return longer * norm(bias.gyro - p.bias.gyro) > S(options.max_gyro_bias_change) ||
         norm(bias.acceleration - p.bias.acceleration) > S(options.max_acceleration_bias_change);
}

TURBOMAP_END_NAMESPACE
