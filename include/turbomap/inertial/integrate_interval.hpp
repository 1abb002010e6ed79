// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The preintegration of one interval from its samples: between two samples the measurements are taken as constant, at
/// the mean of the two (trapezoid rule). One interval is the work of one thread.

#include <cstdint>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/rotation.hpp"
#include "merge.hpp"
#include "preintegration.hpp"
#include "preintegration_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A preintegration of one step: the body turns by the angular velocity w and has the specific force a, both without
/// bias, for dt seconds.
template <class S>
TURBOMAP_HD preintegration<S> integrate_step(const vec3<S>& w, const vec3<S>& a, const S& dt,
                                             const preintegration_options& with, const imu_bias<S>& bias) {
  const S half = S(0.5) * dt;
  const rotation_jacobian<S> turn(dt * w);
  preintegration<S> p;
  p.dt = dt, p.bias = bias;
  p.dR = turn.exp;
  p.J_Rg = (S(0) - dt) * turn.right;
  mat3<S> M = identity3<S>();  // of the force
  if (with.rule == integration_rule::midpoint) {
    const rotation_jacobian<S> middle(half * w);
    M = middle.exp;
    p.J_Vg = (half * dt) * (M * skew(a) * middle.right);
  }
  p.dV = M * (dt * a), p.J_Va = (S(0) - dt) * M;
  p.dP = half * p.dV, p.J_Pg = half * p.J_Vg, p.J_Pa = half * p.J_Va;

  // Noise of a measurement does what a bias does.
  const imu_noise& noise = with.noise;
  const S seconds = noise.rate > 0 ? S(1 / noise.rate) : dt;
  const S gyro = S(noise.gyro * noise.gyro) / seconds, force = S(noise.acceleration * noise.acceleration) / seconds;
  const mat3<S> Rt = gyro * transpose(p.J_Rg), Vt = gyro * transpose(p.J_Vg);
  p.C_RR = p.J_Rg * Rt, p.C_VR = p.J_Vg * Rt;
  p.C_VV = p.J_Vg * Vt + (force * dt * dt) * identity3<S>();
  p.C_PR = half * p.C_VR, p.C_PV = half * p.C_VV, p.C_PP = (half * half) * p.C_VV;
  p.gyro_walk = S(noise.gyro_walk * noise.gyro_walk) * seconds;
  p.acceleration_walk = S(noise.acceleration_walk * noise.acceleration_walk) * seconds;
  return p;
}

/// The measurement at time t on the line through samples i and i + 1. Farther out than twice the time between them it stays what
/// it is there: of two samples whose times are close, as drivers stamp them in bursts, the slope is noise.
TURBOMAP_HD inline imu_sample sample_at(const std::int64_t* t_ns, const imu_sample* sample, int i, std::int64_t t) {
  const double along = static_cast<double>(t - t_ns[i]) / static_cast<double>(t_ns[i + 1] - t_ns[i]);
  const double share = along < -2 ? -2 : along > 3 ? 3 : along;
  const auto mix = [share](const vec3<double>& a, const vec3<double>& b) { return a + share * (b - a); };
  return {mix(sample[i].gyro, sample[i + 1].gyro), mix(sample[i].acceleration, sample[i + 1].acceleration)};
}

/// The preintegration of one interval at a bias.
template <class S>
TURBOMAP_HD preintegration<S> integrate_interval(const std::int64_t* t_ns, const imu_sample* sample,
                                                 const imu_interval& in, const imu_bias<S>& bias,
                                                 const preintegration_options& options) {
  preintegration<S> p;
  p.bias = bias;
  std::int64_t t = in.begin_ns;
  imu_sample from = sample_at(t_ns, sample, in.first, t);
  for (int i = in.first + 1; i <= in.last; ++i) {
    const bool ends = i == in.last;
    const std::int64_t next = ends ? in.end_ns : t_ns[i];
    const imu_sample to = ends ? sample_at(t_ns, sample, i - 1, next) : sample[i];
    const vec3<S> w = cast<S>(0.5 * (from.gyro + to.gyro)) - bias.gyro;
    const vec3<S> a = cast<S>(0.5 * (from.acceleration + to.acceleration)) - bias.acceleration;
    p = append(p, integrate_step(w, a, S(static_cast<double>(next - t) * 1e-9), options, bias));
    t = next, from = to;
  }
  return p;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
