// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Preintegration, merging, prediction, the integrator of tracking and the initialisation, on hostile samples and times.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include <turbomap/inertial/imu_integrator.hpp>
#include <turbomap/inertial/initialise.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/inertial/preintegrate.hpp>

#include "hostile.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;

std::int64_t time(choices& c, std::int64_t ordinary) {
  static constexpr std::int64_t ends[] = {std::numeric_limits<std::int64_t>::min(),
                                          std::numeric_limits<std::int64_t>::max(),
                                          0,
                                          -1,
                                          1,
                                          std::int64_t{1} << 62,
                                          -(std::int64_t{1} << 62)};
  const unsigned kind = c.byte();
  return kind % 16 == 15 ? ends[kind / 16 % std::size(ends)] : ordinary + static_cast<std::int64_t>(c.byte()) * 1000;
}
turbomap::imu_sample sample(choices& c) {
  turbomap::imu_sample s;
  s.gyro = {0.01 * c.byte() - 1.28, 0.01 * c.byte() - 1.28, 0.01 * c.byte() - 1.28};
  s.acceleration = {0.1 * c.byte() - 12.8, 0, 9.81};
  if (c.byte() % 8 == 0) s.gyro = c.vector(10);
  if (c.byte() % 8 == 0) s.acceleration = c.vector(100);
  return s;
}
turbomap::imu_bias<double> bias(choices& c) {
  turbomap::imu_bias<double> b;
  if (c.flag()) b.gyro = c.vector(0.1);
  if (c.flag()) b.acceleration = c.vector(1);
  return b;
}
turbomap::preintegration_options options(choices& c) {
  turbomap::preintegration_options o;
  o.rule = c.flag() ? turbomap::integration_rule::midpoint : turbomap::integration_rule::first_order;
  if (c.flag()) o.max_gap = c.number(1);
  if (c.flag()) o.max_extrapolation = c.number(1);
  if (c.byte() % 4 == 0) o.noise.gyro = c.number(1), o.noise.rate = c.number(200);
  return o;
}

void intervals(choices& c) {
  const auto o = options(c);
  std::vector<std::int64_t> t;
  std::vector<turbomap::imu_sample> samples;
  for (std::size_t i = 0, n = c.below(12); i < n; ++i)
    t.push_back(time(c, static_cast<std::int64_t>(i) * 5000000)), samples.push_back(sample(c));
  const turbomap::imu_samples all{t, samples};
  std::vector<turbomap::imu_interval> in;
  std::vector<turbomap::imu_bias<double>> at;
  for (std::size_t n = c.below(4); n > 0; --n) {
    turbomap::imu_interval one;
    const auto begin = time(c, 0), end = time(c, 20000000);
    if (!allowed([&] { one = turbomap::find_interval(all, begin, end); })) {
      one.begin_ns = begin, one.end_ns = end;
      one.first = static_cast<std::int32_t>(c.byte()) - 2, one.last = static_cast<std::int32_t>(c.byte()) - 2;
    }
    in.push_back(one), at.push_back(bias(c));
  }
  turbomap::context<policy> ctx;
  turbomap::preintegrations<double, policy> result(ctx);
  if (!allowed([&] {
        turbomap::preintegrate<double>(ctx, all, turbomap::span<const turbomap::imu_interval>(in),
                                       turbomap::span<const turbomap::imu_bias<double>>(at), o, result);
      }))
    return;
  const auto found = result.values(ctx);
  expect(found.size() == in.size(), "every interval has its motion");
  turbomap::preintegration<double> sum;
  for (const auto& p : found) {
    expect(p.dt > 0 && finite({p.dt}), "time passes");
    sum = turbomap::merge(sum, p);
  }
  turbomap::inertial_state<double> state;
  if (c.flag()) spoil(state.T_cw, c);
  turbomap::predict(state, sum, {0, 0, -9.81});
}

void integrator(choices& c) {
  const auto o = options(c);
  allowed([&] {
    turbomap::imu_integrator<double> imu(o, bias(c));
    std::int64_t now = 0;
    while (!c.empty()) {
      const unsigned what = c.byte() % 8;
      now += 1000000 * static_cast<std::int64_t>(c.below(8));
      allowed([&] {
        if (what < 4) imu.push(time(c, now), sample(c));
        if (what == 4) imu.restart(time(c, now));
        if (what == 5 || what == 6) expect(imu.advance(time(c, now)).dt > 0, "time passes");
        if (what == 7) imu.set_bias(bias(c));
      });
    }
    expect(imu.history().t_ns.size() == imu.history().sample.size(), "every time has its sample");
  });
}

/// Keyframes on a curve, whose motions fit, but for some numbers.
void initialisation(choices& c) {
  std::vector<turbomap::rigid_transform<double>> T_cw;
  std::vector<turbomap::preintegration<double>> motion;
  const std::size_t count = c.below(16);
  for (std::size_t i = 0; i < count; ++i) {
    turbomap::rigid_transform<double> T;
    const double a = 0.2 * static_cast<double>(i);
    T.tx = std::sin(a) + 0.001 * c.byte(), T.ty = 0.3 * std::cos(2 * a), T.tz = 0.1 * a;
    T.qz = 0.3 * std::sin(a), T.qw = std::sqrt(1 - T.qz * T.qz);
    T_cw.push_back(T);
    if (i == 0) continue;
    turbomap::preintegration<double> p;
    p.dt = 0.25;
    p.dV = {0.1 * c.byte() - 12, 0.01 * c.byte(), 2.45}, p.dP = {0.01 * c.byte(), 0, 0.3};
    for (int k = 0; k < 3; ++k) {
      p.C_RR(k, k) = p.C_VV(k, k) = 1e-4, p.C_PP(k, k) = 1e-5;
      p.J_Rg(k, k) = p.J_Va(k, k) = -0.25, p.J_Pa(k, k) = -0.03;
    }
    p.gyro_walk = p.acceleration_walk = 1e-6;
    if (c.byte() % 8 == 0) p.dt = c.number(1);
    if (c.byte() % 8 == 0) p.dV = c.vector(10);
    if (c.byte() % 8 == 0) p.C_VV(0, 0) = c.number(1);
    motion.push_back(p);
  }
  if (count > 0 && c.byte() % 4 == 0) spoil(T_cw[c.below(count)], c);
  turbomap::initialisation_options o;
  o.monocular = c.flag(), o.min_keyframes = 5, o.min_seconds = 0.5;
  if (c.flag()) o.max_scale_sigma = o.max_gravity_sigma = 10;
  allowed([&] {
    const auto found = turbomap::initialise_inertial(T_cw, motion, {turbomap::identity3<double>(), {0, 0, 0}}, o);
    if (!found) return;
    expect(finite({found.scale, found.gravity.x, found.gravity.y, found.gravity.z}) && found.scale > 0,
           "what is initialised is finite");
    expect(found.velocity.size() == count, "every keyframe has its velocity");
    for (const auto& v : found.velocity) expect(finite({v.x, v.y, v.z}), "velocities are finite");
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned what = c.byte() % 3;
  if (what == 0) intervals(c);
  if (what == 1) integrator(c);
  if (what == 2) initialisation(c);
  return 0;
}
