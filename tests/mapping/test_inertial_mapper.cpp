// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping in inertial mode: the IMU takes part in adjustment, culling leaves no gap and merges motions, deadline and stop
// hold; on a map itself and on a mirror of it.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>

#include <atomic>
#include <cmath>
#include <vector>

#include "scenes/inertial_motion.hpp"
#include "scenes/mapping_scene.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::isometry;
using turbomap::preintegration;
using turbomap::vec3;
using inertial_map = turbomap::simple_inertial_map<turbomap::binary_descriptor<256>, pinhole_camera>;
/// The same map, of which the mapper works on a copy.
struct mirrored_inertial_map : inertial_map {
  using inertial_map::inertial_map;
};

}  // namespace

template <>
struct turbomap::map_traits<mirrored_inertial_map> : turbomap::map_traits<inertial_map> {
  static constexpr bool mirrored = true;
};
template <>
struct turbomap::inertial_traits<mirrored_inertial_map> : turbomap::inertial_traits<inertial_map> {};

namespace {

template <class Map, class Policy>
void check_chain() {
  mapping_recipe recipe;
  recipe.pixel_noise = 0.4;
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  const auto options = culled_inertial_options(recipe);
  inertial_mapping<Map, Policy> run(scene, options);
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
}
TEST_CASE_TEMPLATE("keyframes are culled, and the chain of motions stays whole", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  check_chain<inertial_map, Policy>();
}
TEST_CASE("the same where the mapper works on a mirror") { check_chain<mirrored_inertial_map, sequential>(); }

/// Poses, velocities, biases and motions of keyframes, positions of points, one after the other.
std::vector<double> numbers_of(const inertial_map& map) {
  std::vector<double> all;
  const auto add = [&](const vec3<double>& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  using traits = turbomap::map_traits<inertial_map>;
  traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) {
    const auto& T = map.T_cw(k);
    all.insert(all.end(), {T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz});
    add(map.velocity(k)), add(map.bias(k).gyro), add(map.bias(k).acceleration);
    if (const auto* p = map.motion(k)) all.push_back(p->dt), add(p->dP), add(p->dV);
  });
  traits::for_each_point(map, [&](turbomap::map_point_id p) { add(traits::position(map, p)); });
  return all;
}

TEST_CASE("a mirrored map with an IMU is left as the map itself would be, to the last bit") {
  twin_inertial_mapping<inertial_map, mirrored_inertial_map, sequential> twins;
  for (int n = 0; n < 24; ++n) {
    CAPTURE(n);
    twins.step();
    CHECK(twins.refused == 0);
    CHECK(twins.healed == 0);
    REQUIRE(numbers_of(twins.first()) == numbers_of(twins.second()));
  }
  CHECK(twins.culled > 4);
  CHECK(twins.adjusted > 30);
}

TEST_CASE("what tracking changed of a mirrored keyframe, unreported, is read with its velocity") {
  mapping_recipe recipe;
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  inertial_mapping<mirrored_inertial_map, sequential> run(scene, culled_inertial_options(recipe));
  run.map.set_gravity(motion.gravity), run.map.set_initialised(true);
  run.mapper.options().checked_share = 0;
  for (int n = 0; n < 8; ++n) run.mapper.process(track(run, motion));
  const auto k = track(run, motion);
  const auto before = run.keyframes()[run.keyframes().size() - 3];  // not the one that the sample check comes to
  auto T = run.map.T_cw(before);
  T.tx += 1e-3;
  run.map.set_pose(before, T);
  run.map.set_velocity(before, motion.velocity(6) + vec3<double>{1e-3, 0, 0});
  for (const auto stage : {turbomap::mapping_stage::search, turbomap::mapping_stage::fusion})  // they read poses, too
    run.mapper.options().enabled[stage] = false;
  const auto& report = run.mapper.process(k);
  CHECK(!report.adjustment.stale);
  CHECK(report.adjustment.solve.accepted > 0);
}

TEST_CASE("stop and deadline leave the inertial stage out") {
  mapping_recipe recipe;
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  bool stop = false;
  turbomap::local_mapper_hooks<inertial_map> hooks;
  hooks.stop = [&] { return stop; };
  inertial_mapping<inertial_map, sequential> run(scene, culled_inertial_options(recipe), hooks);
  run.map.set_gravity(motion.gravity), run.map.set_initialised(true);
  for (int n = 0; n < 6; ++n) run.mapper.process(track(run, motion));
  const auto adjusting = turbomap::mapping_stage::adjustment;
  stop = true;
  CHECK(run.mapper.process(track(run, motion)).outcome[adjusting] == turbomap::stage_outcome::skipped);
  stop = false;
  run.mapper.options().deadline_ms = 1e-6;
  CHECK(run.mapper.process(track(run, motion)).outcome[adjusting] == turbomap::stage_outcome::cut);
  run.mapper.options().deadline_ms = 0;
  const std::atomic<bool> flag{true};
  run.mapper.options().adjustment.solve.stop = &flag;
  CHECK(run.mapper.process(track(run, motion)).adjustment.solve.end == turbomap::adjustment_end::stopped);
}

TEST_CASE("a motion that cannot be used is reported, and mapping goes on; strict: it ends the stage") {
  mapping_recipe recipe;
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  inertial_mapping<inertial_map, sequential> run(scene, culled_inertial_options(recipe));
  run.map.set_gravity(motion.gravity), run.map.set_initialised(true);
  for (int n = 0; n < 6; ++n) run.mapper.process(track(run, motion));
  const auto k = track(run, motion);
  auto p = *run.map.motion(k);
  p.dP.y = std::nan("");
  run.map.set_motion(k, p);
  const auto& report = run.mapper.process(k);
  REQUIRE(report.refused.size() == 1);
  CHECK(report.refused[0].fault == turbomap::map_fault::bad_motion);
  CHECK(report.adjustment.inertial);
  CHECK(report.adjustment.solve.accepted > 0);
  run.mapper.options().strict = true;
  CHECK_THROWS_AS(run.mapper.process(track(run, motion)), turbomap::inconsistent_map);
  CHECK(turbomap::validate(run.map).empty());
}

}  // namespace
