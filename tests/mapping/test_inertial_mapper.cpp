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

#include "inertial_mapper_cases.hpp"
#include "scenes/mirrored_map.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::isometry;
using turbomap::preintegration;
using turbomap::vec3;
using inertial_map = mapped_inertial;
/// The same map, of which the mapper works on a copy.
using mirrored_inertial_map = mirrored_map<inertial_map>;

TEST_CASE("keyframes are culled, and the chain of motions stays whole: the same bits under two policies") {
  const auto expected = check_chain<inertial_map>(sequential{});
  CHECK(check_chain<inertial_map>(parallel{}) == expected);
}
TEST_CASE("the IMU is initialised in the run, and mapping goes on with it: the same bits under two policies") {
  const auto expected = check_initialised_in_run(sequential{});
  CHECK(check_initialised_in_run(parallel{}) == expected);
}
TEST_CASE("the same where the mapper works on a mirror") { check_chain<mirrored_inertial_map>(sequential{}); }

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

/// A mapper with a marginal prior, whose windows are short enough to slide.
turbomap::local_mapper_options sliding_options() {
  auto o = culled_inertial_options({});
  o.inertial.marginal_prior = true, o.inertial.strong_points = -1, o.inertial.window.keyframes = 3;
  return o;
}

TEST_CASE("a mirrored map with a marginal prior is left as the map itself would be, to the last bit") {
  auto without = sliding_options();
  without.inertial.marginal_prior = false;
  twin_inertial_mapping<inertial_map, mirrored_inertial_map, sequential> twins(sliding_options()), others(without);
  for (int n = 0; n < 16; ++n) {
    CAPTURE(n);
    twins.step(), others.step();
    CHECK(twins.refused == 0);
    CHECK(twins.healed == 0);
    REQUIRE(numbers_of(twins.first()) == numbers_of(twins.second()));
  }
  CHECK(twins.adjusted > 15);
  CHECK(numbers_of(twins.first()) != numbers_of(others.first()));  // there was a prior
}

TEST_CASE("a mapper that starts anew knows nothing of the keyframe before a window") {
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), noisy_recipe());
  const true_motion motion{scene};
  inertial_mapping<inertial_map, sequential> run(scene, sliding_options());
  run.mapper.options().enabled[turbomap::mapping_stage::keyframe_culling] = false;
  run.map.set_gravity(motion.gravity), run.map.set_initialised(true);
  const auto moves = [&](turbomap::map_keyframe_id k) { return run.mapper.process(k).adjustment.free_keyframes; };
  for (int n = 0; n < 9; ++n) run.mapper.process(track(run, motion));
  CHECK(moves(track(run, motion)) == 4);  // three, and the one before them
  CHECK(moves(run.keyframes().back()) == 4);
  run.mapper.reset();
  for (std::size_t n = 0; n < run.keyframes().size(); ++n)
    run.mapper.insert(run.keyframes()[n], scene.data<turbomap::binary_descriptor<256>>(run.view(n)));
  CHECK(moves(run.keyframes().back()) == 3);
  CHECK(moves(track(run, motion)) == 4);  // from now on, again
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
