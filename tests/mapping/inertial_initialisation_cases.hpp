// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Maps whose IMU is not initialised yet, and the first windows after it was.

#include <doctest/doctest.h>

#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cstddef>

#include "inertial_window_cases.hpp"

namespace turbomap_test {

/// A map that knows its poses, but nothing of the IMU; in another unit of length, and with biases of 0.
inline inertial_map_scene visual_scene(double unit, unsigned seed = 1, int keyframes = 20) {
  inertial_map_scene s({keyframes, 10, seed, 0.0, 0.0});
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

/// Windows after an initialisation do what they do on the host, and take velocities that were disturbed back to the
/// truth.
template <class Policy>
void check_after_initialisation(const Policy& policy) {
  for (const bool monocular : {false, true}) {
    CAPTURE(monocular);
    auto s = visual_scene(monocular ? 0.4 : 1);
    turbomap::initialisation_options options;
    options.monocular = monocular;
    turbomap::inertial_initialisation<inertial_map> initialise;
    REQUIRE(initialise(s.map, s.keyframes.back(), options).end == turbomap::initialisation_end::initialised);
    for (const bool refined : {false, true}) {
      CAPTURE(refined);
      s.map.set_refined(refined);
      for (std::size_t f = 15; f < 20; ++f)
        s.map.set_velocity(s.keyframes[f], s.map.velocity(s.keyframes[f]) + vec3<double>{0.02, -0.01, 0.03});
      const auto summary = adjust_as_on_host(policy, s, 19, window_of(refined ? 8 : 40));
      CHECK(summary.free_keyframes == (refined ? 8 : 20));
      CHECK(s.velocity_error(15, 20) < 2e-3);
    }
  }
}

}  // namespace turbomap_test
