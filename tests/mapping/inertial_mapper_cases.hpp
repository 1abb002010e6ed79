// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping in inertial mode must do under every execution policy, host or device: cull without a gap in
/// the chain of motions, and map on when the IMU is initialised in the run.

#include <doctest/doctest.h>

#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

#include "reference/larger_or_nan.hpp"
#include "scenes/inertial_motion.hpp"
#include "scenes/mapping_scene.hpp"

namespace turbomap_test {

/// Gravity; poses, velocities, biases and motions of keyframes; positions of points; one after the other.
inline std::vector<double> numbers_of(const mapped_inertial& map) {
  std::vector<double> all;
  const auto add = [&](const turbomap::vec3<double>& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  const auto add_rotation = [&](const turbomap::mat3<double>& R) {
    for (int i = 0; i < 9; ++i) all.push_back(R(i / 3, i % 3));
  };
  using traits = turbomap::map_traits<mapped_inertial>;
  add(map.gravity());
  traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) {
    const auto& T = map.T_cw(k);
    all.insert(all.end(), {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz});
    add(map.velocity(k)), add(map.bias(k).gyro), add(map.bias(k).acceleration);
    if (const auto* p = map.motion(k)) all.push_back(p->dt), add_rotation(p->dR), add(p->dP), add(p->dV);
  });
  traits::for_each_point(map, [&](turbomap::map_point_id p) { add(traits::position(map, p)); });
  return all;
}

/// Keyframes are culled, and the chain of motions stays whole.
/// \param numbers  of the adjustments
/// \return the numbers of the map
template <class Map, class Methods = turbomap::adjustment_methods<>, class Policy>
std::vector<double> check_chain(const Policy& policy, turbomap::precision numbers = turbomap::precision::mixed) {
  const mapping_recipe recipe = noisy_recipe();
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  auto options = culled_inertial_options(recipe);
  options.adjustment.solve.numbers = numbers;
  inertial_mapping<Map, Policy, Methods> run(scene, options, {}, policy);
  run.map.set_gravity(motion.gravity);
  std::size_t culled = 0, merged = 0;
  for (int n = 0; n < 30; ++n) {
    CAPTURE(n);
    const auto k = track(run, motion);
    run.map.set_initialised(n >= 10);
    const auto& report = run.mapper.process(k);
    CHECK(report.refused.empty());
    CHECK(report.adjustment.inertial == (n >= 10));
    if (n >= 10) CHECK(report.adjustment.inertial_edges > 0);
    culled += report.keyframes_culled.size();
    REQUIRE(turbomap::validate(run.map).empty());
    CHECK((report.keyframes_culled.empty() || run.map.keyframe_count() >= 8));
    std::vector<int> left;
    for (int i = 0; i <= n; ++i)
      if (run.map.alive(run.keyframes()[static_cast<std::size_t>(i)])) left.push_back(i);
    REQUIRE(left.size() == run.map.keyframe_count());
    for (std::size_t i = 1; i < left.size(); ++i) {
      const double gap = step_s * (left[i] - left[i - 1]);
      CHECK(gap < 1.05);
      if (n < 10) CHECK(gap < 0.45);
      const auto* p = run.map.motion(run.keyframes()[static_cast<std::size_t>(left[i])]);
      REQUIRE(p != nullptr);
      const auto expected = motion.between(left[i - 1], left[i]);
      CHECK(std::abs(p->dt - expected.dt) < 1e-9);
      CHECK(turbomap::norm(p->dP - expected.dP) < 1e-9);
      CHECK(turbomap::norm(p->dV - expected.dV) < 1e-9);
      merged += left[i] - left[i - 1] > 1 ? 1 : 0;
    }
    for (int last = n; last > n - 3 && last >= 0; --last) CHECK(left[left.size() - 1 - (n - last)] == last);
  }
  CHECK(culled > 4);
  CHECK(merged > 20);
  return numbers_of(run.map);
}

/// A mapper that starts without knowing gravity, velocities or biases, and is told of them by inertial_initialisation
/// in the run.
/// \param numbers  of the adjustments
/// \return the numbers of the map
template <class Methods = turbomap::adjustment_methods<>, class Policy>
std::vector<double> check_initialised_in_run(const Policy& policy,
                                             turbomap::precision numbers = turbomap::precision::mixed) {
  const mapping_recipe recipe = noisy_recipe();
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  auto options = culled_inertial_options(recipe);
  options.adjustment.solve.numbers = numbers;
  inertial_mapping<mapped_inertial, Policy, Methods> run(scene, options, {}, policy);
  turbomap::inertial_initialisation<mapped_inertial> initialise;
  int initialised_at = -1;
  for (int n = 0; n < 30; ++n) {
    CAPTURE(n);
    const auto k = track(run, motion);
    if (!run.map.initialised()) run.map.set_velocity(k, {0, 0, 0});
    const auto& report = run.mapper.process(k);
    CHECK(report.refused.empty());
    CHECK(report.adjustment.inertial == (initialised_at >= 0));
    REQUIRE(turbomap::validate(run.map).empty());
    if (initialised_at < 0 && initialise(run.map, k)) initialised_at = n;
    run.map.set_refined(initialised_at >= 0 && n > initialised_at + 5);
  }
  MESSAGE("initialised at keyframe " << initialised_at);
  REQUIRE(initialised_at >= 0);
  CHECK(initialised_at < 25);
  const auto& g = run.map.gravity();
  CHECK(turbomap::dot(g, motion.gravity) / (turbomap::norm(g) * turbomap::norm(motion.gravity)) > std::cos(0.03));
  REQUIRE(run.map.alive(run.keyframes().back()));
  double worst = 0;
  for (std::size_t n = 24; n < 30; ++n) {
    using turbomap::operator-;
    if (!run.map.alive(run.keyframes()[n])) continue;
    worst = larger_or_nan(worst,
                          turbomap::norm(run.map.velocity(run.keyframes()[n]) - motion.velocity(static_cast<int>(n))));
  }
  MESSAGE("velocities: " << worst << " m/s from the truth");
  CHECK(worst < 0.03);
  return numbers_of(run.map);
}

}  // namespace turbomap_test
