// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Initialisation: against a dense oracle; 200 random motions, with and without what tells the scale; inputs that cannot be used;
// the alignment of the world; the times of the refinements.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <turbomap/inertial/initialisation_schedule.hpp>
#include <turbomap/inertial/world_alignment.hpp>

#include "initialisation_cases.hpp"
#include "preintegration_cases.hpp"
#include "reference/initialisation_oracle.hpp"
#include "reference/larger_or_nan.hpp"

namespace {

using namespace turbomap_test;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

initialisation_options options_of(bool monocular) {
  initialisation_options o;
  o.monocular = monocular;
  return o;
}

oracle_estimate estimate_of(const initialisation& found) {
  oracle_estimate x{
      to_eigen(found.bias.gyro), to_eigen(found.bias.acceleration), to_eigen(found.gravity), found.scale, {}};
  for (const auto& v : found.velocity) x.velocity.push_back(to_eigen(v));
  return x;
}

oracle_initialisation oracle_of(const recorded_motion& m, const std::vector<preintegration<double>>& motion,
                                const initialisation_options& options, const initialisation& found) {
  oracle_initialisation o;
  for (const auto& T : m.T_cw) {
    const auto I = turbomap::to_isometry<double>(turbomap::normalised(T));
    o.R_cw.push_back(to_eigen(I.R)), o.t_cw.push_back(to_eigen(I.t));
  }
  o.R_bc = to_eigen(m.T_bc.R), o.t_bc = to_eigen(m.T_bc.t);
  for (const auto& p : motion) {
    oracle_preintegration q;
    q.dt = p.dt, q.R = to_eigen(p.dR), q.V = to_eigen(p.dV), q.P = to_eigen(p.dP);
    q.J_Rg = to_eigen(p.J_Rg), q.J_Vg = to_eigen(p.J_Vg), q.J_Va = to_eigen(p.J_Va);
    q.J_Pg = to_eigen(p.J_Pg), q.J_Pa = to_eigen(p.J_Pa), q.C = covariance_of(p);
    o.motion.push_back(q);
    o.motion_gyro.push_back(to_eigen(p.bias.gyro)), o.motion_acceleration.push_back(to_eigen(p.bias.acceleration));
  }
  o.monocular = options.monocular;
  o.rotation_sigma = found.rotation_sigma, o.position_sigma = found.position_sigma;
  const turbomap::imu_noise noise;  // densities of the walks; a window of so many seconds
  o.gyro_spread = noise.gyro_walk * std::sqrt(found.seconds / 6);
  o.acceleration_spread = noise.acceleration_walk * std::sqrt(found.seconds / 6);
  o.gyro_sigma = options.gyro_bias_sigma, o.acceleration_sigma = options.acceleration_bias_sigma;
  return o;
}

TEST_CASE("the estimate is that of a dense problem with numerical derivatives, from another start") {
  for (const bool monocular : {true, false})
    for (unsigned seed = 0; seed < 4; ++seed) {
      CAPTURE(monocular);
      CAPTURE(seed);
      const auto m = make_motion(seed, motion_kind::lively, 5, monocular ? 0.4 + seed : 1);
      const auto options = options_of(monocular);
      const auto motion = motions_of(m, m.T_cw.size(), m.bias);
      const auto found = turbomap::initialise_inertial(m.T_cw, motion, m.T_bc, options);
      REQUIRE(found.end != initialisation_end::not_converged);
      const oracle_initialisation o = oracle_of(m, motion, options, found);
      oracle_estimate start = estimate_of(found);
      start.gravity = oracle_exp({0.1, -0.1, 0.1}) * start.gravity, start.scale *= monocular ? 1.2 : 1;
      start.acceleration.setZero();
      for (auto& v : start.velocity) v.array() += 0.2;
      const oracle_estimate x = o.solve(start, estimate_of(found));
      CHECK(std::abs(found.scale / x.scale - 1) < 1e-6);
      CHECK((to_eigen(found.gravity) - x.gravity).norm() < 1e-5);
      CHECK((to_eigen(found.bias.gyro) - x.gyro).norm() < 1e-7);
      CHECK((to_eigen(found.bias.acceleration) - x.acceleration).norm() < 1e-5);
      double velocity = 0;
      for (std::size_t k = 0; k < x.velocity.size(); ++k)
        velocity = larger_or_nan(velocity, (to_eigen(found.velocity[k]) - x.velocity[k]).norm());
      CHECK(velocity < 1e-5);
    }
}

TEST_CASE("without noise the truth is found") {
  motion_noise none{0, 0, 0, {}, 0.04, 0.1};
  none.imu = {1e-7, 1e-6, 1e-9, 1e-9, 0};
  for (unsigned seed = 0; seed < 5; ++seed) {
    const auto m = make_motion(seed, motion_kind::lively, 6, 0.2 * (seed + 1), none);
    imu_bias<double> bias{};
    const auto found = initialise(m, m.T_cw.size(), options_of(true), bias);
    REQUIRE(found);
    CHECK_FALSE(found.integrate_again);
    CHECK(found.scale == doctest::Approx(m.scale).epsilon(1e-3));
    CHECK(turbomap::norm(found.gravity - m.gravity) < 1e-2);
    CHECK(turbomap::norm(found.bias.gyro - m.bias.gyro) < 1e-4);
    CHECK(turbomap::norm(found.bias.acceleration - m.bias.acceleration) < 1e-2);
    for (std::size_t k = 0; k < m.velocity.size(); ++k) CHECK(turbomap::norm(found.velocity[k] - m.velocity[k]) < 5e-3);
  }
}

/// The first initialisation that succeeds as keyframes come.
initialisation first_success(const recorded_motion& m, const initialisation_options& options) {
  initialisation found;
  imu_bias<double> bias{};
  for (std::size_t k = 10; k <= m.T_cw.size() && !found; k += 2) found = initialise(m, k, options, bias = {});
  return found;
}

TEST_CASE("200 random motions of one camera: initialised within 15 s, the scale right to 1 %") {
  double worst_scale = 0, worst_gravity = 0, latest = 0, squares = 0;
  int initialised = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const auto m = make_motion(1000 + seed, motion_kind::lively, 15, std::exp(2 * std::sin(1.7 * seed)));
    const auto found = first_success(m, options_of(true));
    initialised += static_cast<bool>(found);
    const double off = found.scale / m.scale - 1;
    worst_scale = larger_or_nan(worst_scale, std::abs(off)), squares += std::pow(off / found.scale_sigma, 2);
    const double cosine = turbomap::dot(found.gravity, m.gravity) / (9.81 * 9.81);
    worst_gravity = larger_or_nan(worst_gravity, std::acos(std::min(cosine, 1.0)));
    latest = std::max(latest, found.seconds);
  }
  MESSAGE("initialised " << initialised << " of 200, latest after " << latest << " s; largest error of the scale "
                         << worst_scale << ", in its standard deviations rms " << std::sqrt(squares / 200)
                         << "; of gravity " << worst_gravity << " rad");
  CHECK(initialised == 200);
  CHECK(worst_scale <= 0.01);
  CHECK(worst_gravity < 0.03);
  CHECK(std::sqrt(squares / 200) < 1.3);  // the standard deviation is one
}

TEST_CASE("poses in any unit: millimetres, or hundreds of kilometres") {
  for (const double unit : {1e4, 1e3, 1e-3, 1e-5})
    for (unsigned seed = 0; seed < 10; ++seed) {
      CAPTURE(unit);
      CAPTURE(seed);
      const auto m = make_motion(1000 + seed, motion_kind::lively, 15, 1);
      auto other = m;
      for (auto& T : other.T_cw) T.tx *= unit, T.ty *= unit, T.tz *= unit;
      imu_bias<double> bias{};
      const auto found = initialise(m, m.T_cw.size(), options_of(true), bias);
      const auto in_unit = initialise(other, m.T_cw.size(), options_of(true), bias = {});
      REQUIRE(found.end == initialisation_end::initialised);
      CHECK(in_unit.end == found.end);
      CHECK(in_unit.scale * unit == doctest::Approx(found.scale).epsilon(1e-3));
      CHECK(in_unit.position_sigma == doctest::Approx(unit * found.position_sigma).epsilon(0.05));
    }
}

TEST_CASE("what does not tell the scale: not initialised") {
  for (const auto kind : {motion_kind::still, motion_kind::constant_velocity, motion_kind::pure_rotation,
                          motion_kind::rotation_at_constant_velocity})
    for (unsigned seed = 0; seed < 50; ++seed) {
      CAPTURE(static_cast<int>(kind));
      CAPTURE(seed);
      const auto m = make_motion(3000 + seed, kind, 15, std::exp(std::sin(1.7 * seed)));
      imu_bias<double> bias{};
      for (std::size_t k = 10; k <= m.T_cw.size(); k += 10)
        CHECK(initialise(m, k, options_of(true), bias = {}).end == initialisation_end::scale_unknown);
    }
}

TEST_CASE("stereo: gravity and velocities; at rest the bias could be gravity's error") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    CAPTURE(seed);
    auto m = make_motion(seed, motion_kind::lively, 8, 1);
    const auto found = first_success(m, options_of(false));
    REQUIRE(found);
    CHECK(found.scale == 1);
    CHECK(found.scale_sigma == 0);
    CHECK(std::acos(turbomap::dot(found.gravity, m.gravity) / (9.81 * 9.81)) < 0.03);
    for (std::size_t k = 0; k < found.velocity.size(); ++k)
      CHECK(turbomap::norm(found.velocity[k] - m.velocity[k]) < 0.05);
    m = make_motion(seed, motion_kind::still, 8, 1);
    CHECK(first_success(m, options_of(false)).end == initialisation_end::gravity_unknown);
  }
}

TEST_CASE("too little, a gap, wrong arguments") {
  const auto m = make_motion(3, motion_kind::lively, 6, 1);
  auto motion = motions_of(m, m.T_cw.size(), {});
  const auto options = options_of(true);
  const auto run = [&](std::size_t keyframes) {
    return turbomap::initialise_inertial({m.T_cw.data(), keyframes},
                                         {motion.data(), std::max<std::size_t>(1, keyframes) - 1}, m.T_bc, options);
  };
  CHECK(run(0).end == initialisation_end::too_few_keyframes);
  CHECK(run(1).end == initialisation_end::too_few_keyframes);
  CHECK(run(9).end == initialisation_end::too_few_keyframes);
  auto slow = options;
  slow.min_seconds = 10;
  CHECK(turbomap::initialise_inertial(m.T_cw, motion, m.T_bc, slow).end == initialisation_end::too_short);
  const auto good = motion;
  motion[4] = {};
  CHECK(run(m.T_cw.size()).end == initialisation_end::interrupted);
  CHECK(run(m.T_cw.size()).edge == 4);
  motion = good, motion[4].dV.y = nan;
  CHECK_THROWS_WITH_AS(run(m.T_cw.size()), doctest::Contains("motion[4]"), std::invalid_argument);
  motion = good, motion[2].dt = -1;
  CHECK_THROWS_WITH_AS(run(m.T_cw.size()), doctest::Contains("motion[2].dt"), std::invalid_argument);
  motion = good, motion[2].C_PP(1, 1) = nan;
  CHECK_THROWS_WITH_AS(run(m.T_cw.size()), doctest::Contains("motion[2]"), std::invalid_argument);
  motion = good;
  auto poses = m.T_cw;
  poses[7].qx = 3;
  CHECK_THROWS_WITH_AS(turbomap::initialise_inertial(poses, motion, m.T_bc, options), doctest::Contains("T_cw[7]"),
                       std::invalid_argument);
  poses.pop_back();
  CHECK_THROWS_WITH_AS(turbomap::initialise_inertial(poses, motion, m.T_bc, options),
                       doctest::Contains("motion.size()"), std::invalid_argument);
  for (double initialisation_options::*member :
       {&initialisation_options::gravity, &initialisation_options::gyro_bias_sigma,
        &initialisation_options::acceleration_bias_sigma, &initialisation_options::max_scale_sigma,
        &initialisation_options::rotation_sigma, &initialisation_options::min_seconds}) {
    auto bad = options;
    bad.*member = nan;
    CHECK_THROWS_AS(turbomap::initialise_inertial(m.T_cw, motion, m.T_bc, bad), std::invalid_argument);
  }
  auto bad_T_bc = m.T_bc;
  bad_T_bc.t.x = nan;
  CHECK_THROWS_WITH_AS(turbomap::initialise_inertial(m.T_cw, motion, bad_T_bc, options), doctest::Contains("T_bc"),
                       std::invalid_argument);
}

TEST_CASE("an IMU that contradicts the poses: not initialised") {
  auto m = make_motion(5, motion_kind::lively, 10, 1);
  const auto good = motions_of(m, m.T_cw.size(), {});
  auto motion = good;
  std::reverse(motion.begin(), motion.end());  // of another time
  CHECK_FALSE(turbomap::initialise_inertial(m.T_cw, motion, m.T_bc, options_of(true)));
  auto turned = m.T_bc;  // mounted otherwise
  turned.R = turbomap::rotation_exp(vec3<double>{0.5, 0.8, 0}) * turned.R;
  CHECK_FALSE(turbomap::initialise_inertial(m.T_cw, good, turned, options_of(true)));
  for (auto& p : motion) p.dV = {0, 0, 0}, p.dP = {0, 0, 0};  // an accelerometer that is stuck at 0
  CHECK_FALSE(turbomap::initialise_inertial(m.T_cw, motion, m.T_bc, options_of(true)));
}

TEST_CASE("the aligned world is metric, its gravity points down, and predictions fit") {
  for (const vec3<double>& direction : {vec3<double>{3, -4, 5}, vec3<double>{0, 0, -1}, vec3<double>{0, 0, 2}}) {
    initialisation found;
    found.gravity = (9.81 / turbomap::norm(direction)) * direction, found.scale = 2.5;
    const auto a = turbomap::alignment_of(found);
    CHECK(turbomap::norm(a.R * found.gravity - vec3<double>{0, 0, -9.81}) < 1e-12);
    CHECK((to_eigen(a.R) * to_eigen(a.R).transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
    CHECK(to_eigen(a.R).determinant() == doctest::Approx(1));
    // What a camera sees of a point keeps its direction, and is so many times as far.
    const auto T =
        turbomap::to_rigid_transform(isometry<double>{turbomap::rotation_exp(vec3<double>{1, 2, -1}), {1, 2, 3}});
    const vec3<double> x{4, -5, 6},
        seen = turbomap::to_isometry<double>(T) * x,
        now = turbomap::to_isometry<double>(turbomap::aligned_pose(a, T)) * turbomap::aligned_point(a, x);
    CHECK(turbomap::norm(now - 2.5 * seen) < 1e-12);
    CHECK(turbomap::norm(turbomap::aligned_velocity(a, x)) == doctest::Approx(turbomap::norm(x)));
  }
  const auto m = make_motion(11, motion_kind::lively, 8, 3);
  imu_bias<double> bias{};
  const auto found = initialise(m, m.T_cw.size(), options_of(true), bias);
  REQUIRE(found);
  const auto a = turbomap::alignment_of(found);
  const auto motion = motions_of(m, m.T_cw.size(), found.bias);
  for (std::size_t k = 0; k < motion.size(); ++k) {
    const auto i = turbomap::aligned_state(a, found, m.T_cw[k], k),
               j = turbomap::aligned_state(a, found, m.T_cw[k + 1], k + 1);
    double r[9];
    turbomap::inertial_residual(motion[k], m.T_bc, i, j, vec3<double>{0, 0, -9.81}, r);
    for (int row = 3; row < 9; ++row) CHECK(std::abs(r[row]) < 0.02);
  }
}

TEST_CASE("refinements after 5 s and 15 s, the scale of one camera every 10 s until 100 s") {
  using turbomap::initialisation_step;
  for (const bool monocular : {false, true}) {
    turbomap::initialisation_schedule schedule(monocular);
    std::vector<int> refined, scaled;
    int started = -1;
    for (int s = 0; s < 200; ++s) {
      const std::int64_t t = 1'700'000'000'000'000'000 + s * 1'000'000'000LL;
      const auto step = schedule.due(t);
      if (step == initialisation_step::none) continue;
      if (s < 3) continue;  // did not succeed: stays due
      CHECK(schedule.initialised() == (step != initialisation_step::initialise));
      if (step == initialisation_step::initialise) started = s;
      if (step == initialisation_step::refine) refined.push_back(s - started);
      if (step == initialisation_step::refine_scale) scaled.push_back(s - started);
      schedule.done(step, t);
    }
    CHECK(started == 3);
    CHECK(refined == std::vector<int>{5, 15});
    CHECK(scaled == (monocular ? std::vector<int>{25, 35, 45, 55, 65, 75, 85, 95} : std::vector<int>{}));
    schedule.restart();
    CHECK(schedule.due(0) == initialisation_step::initialise);
  }
  CHECK_THROWS_AS(turbomap::initialisation_schedule(false, {5, 4, 10, 100}), std::invalid_argument);
}

TEST_CASE("a schedule takes times whose difference 64 bits do not hold") {
  using turbomap::initialisation_step;
  constexpr auto first = std::numeric_limits<std::int64_t>::min(), last = std::numeric_limits<std::int64_t>::max();
  turbomap::initialisation_schedule schedule(true);
  schedule.done(initialisation_step::initialise, first);
  CHECK(schedule.due(last) == initialisation_step::refine);
  schedule.done(initialisation_step::initialise, last);
  CHECK(schedule.due(first) == initialisation_step::none);
}

}  // namespace
