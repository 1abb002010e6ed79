// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Initialisation on a map: what is found is written, in metres; what is not found, or no longer fits, leaves the map alone.

#include <doctest/doctest.h>

#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>

#include "inertial_adjustment_cases.hpp"

namespace turbomap_test {

/// Somebody else changes the map when the initialisation takes the guard again, to write.
struct disturbed_map : inertial_map {
  using inertial_map::inertial_map;
  int guards = 0, change = 0;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::disturbed_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static std::unique_lock<std::mutex> guard(turbomap_test::disturbed_map& m) {
    if (++m.guards == 2) {
      auto k = m.keyframe_at(7);
      if (m.change == 1) m.set_pose(k, {});
      if (m.change == 2)
        turbomap::bridge_motion<turbomap_test::inertial_map>(m, k),
            turbomap::erase_keyframe<turbomap_test::inertial_map>(m, k);
    }
    return {};
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::disturbed_map>
    : turbomap::inertial_traits<turbomap_test::inertial_map> {};

namespace {

using namespace turbomap_test;
using turbomap::initialisation_end;

/// A map that knows its poses, but nothing of the IMU; in another unit of length, and with biases of 0.
inertial_map_scene visual_scene(double unit, unsigned seed = 1) {
  inertial_map_scene s({20, 10, seed, 0.0, 0.0});
  for (std::size_t i = 0; i < s.keyframes.size(); ++i) {
    const auto k = s.keyframes[i];
    auto T = s.truth[i].T_cw;
    T.tx *= unit, T.ty *= unit, T.tz *= unit;
    s.map.set_pose(k, T), s.map.set_velocity(k, {0, 0, 0}), s.map.set_bias(k, {});
    if (i == 0) continue;
    const auto h = s.samples_between(static_cast<int>(i) - 1, static_cast<int>(i));
    s.map.set_motion(k, turbomap::preintegrate(h, imu_bias<double>{}, {}), h);
  }
  for (std::size_t l = 0; l < s.points.size(); ++l)
    inertial_map_traits::set_position(
        s.map, s.points[l], {unit * s.true_points[l].x, unit * s.true_points[l].y, unit * s.true_points[l].z});
  s.map.set_initialised(false), s.map.set_gravity({0, 0, 0});
  return s;
}

TEST_CASE("gravity, velocities, biases and the scale are those of the truth") {
  using turbomap::norm;
  for (const double unit : {1.0, 0.2, 3.0}) {
    CAPTURE(unit);
    auto s = visual_scene(unit);
    turbomap::initialisation_options options;
    options.monocular = unit != 1;
    turbomap::inertial_initialisation<inertial_map> initialise;
    const auto& found = initialise(s.map, s.keyframes.back(), options);
    REQUIRE(found.end == initialisation_end::initialised);
    CHECK(s.map.initialised());
    CHECK(norm(s.map.gravity() - vec3<double>{0, 0, -9.81}) < 0.02);
    CHECK_FALSE(found.integrate_again);  // the samples were integrated at the biases that were found
    for (std::size_t i = 0; i < s.keyframes.size(); ++i) {
      const auto k = s.keyframes[i];
      CHECK(norm(s.map.velocity(k) - s.truth[i].velocity) < 0.02);
      CHECK(norm(s.map.bias(k).gyro - s.truth[i].bias.gyro) < 1e-3);
      CHECK(norm(s.map.bias(k).acceleration - s.truth[i].bias.acceleration) < 0.05);
      const auto &T = s.map.T_cw(k), &truth = s.truth[i].T_cw;
      CHECK(norm(vec3<double>{T.tx - truth.tx, T.ty - truth.ty, T.tz - truth.tz}) <
            0.01 * (1 + norm(vec3<double>{truth.tx, truth.ty, truth.tz})));
    }
    for (std::size_t l = 0; l < s.points.size(); ++l)
      CHECK(norm(s.map.position(s.points[l]) - s.true_points[l]) < 0.01 * (1 + norm(s.true_points[l])));
    CHECK(turbomap::validate(s.map).empty());
  }
}

TEST_CASE("not initialised: the map is as it was") {
  turbomap::inertial_initialisation<inertial_map> initialise;
  auto s = visual_scene(1);
  auto before = s.state();
  CHECK(initialise(s.map, s.keyframes[4]).end == initialisation_end::too_few_keyframes);
  CHECK(initialise(s.map, {}).end != initialisation_end::initialised);
  CHECK(initialise.stale());
  CHECK(s.state() == before);
  s.map.clear_motion(s.keyframes[15]);  // a gap: only what comes after it counts
  before = s.state();
  CHECK(initialise(s.map, s.keyframes.back()).end == initialisation_end::too_few_keyframes);
  CHECK(s.state() == before);
  CHECK_FALSE(s.map.initialised());
  auto bad = *s.map.motion(s.keyframes[18]);
  bad.dP.x = std::numeric_limits<double>::quiet_NaN();
  s.map.set_motion(s.keyframes[18], bad);
  before = s.state();
  CHECK_THROWS_AS(initialise(s.map, s.keyframes.back()), std::invalid_argument);
  CHECK(s.state() == before);
}

TEST_CASE("a keyframe moved or taken out meanwhile: nothing is written") {
  const auto s = visual_scene(1);
  for (const int change : {0, 1, 2}) {
    CAPTURE(change);
    disturbed_map map(8, s.map.T_bc());
    static_cast<inertial_map&>(map) = s.map;
    map.change = change;
    turbomap::inertial_initialisation<disturbed_map> initialise;
    CHECK(initialise(map, s.keyframes.back()).end == initialisation_end::initialised);
    CHECK(initialise.stale() == (change != 0));
    CHECK(map.initialised() == (change == 0));
    CHECK((map.velocity(s.keyframes[3]).x == 0) == (change != 0));
  }
}

}  // namespace
