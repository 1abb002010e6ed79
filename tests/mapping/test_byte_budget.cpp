// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A byte budget of the keyframe store bounds local mapping too: with room for few keyframes an iteration pages, and works in
/// pieces that fit, but it makes the same map and never runs out of memory.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "local_mapper_cases.hpp"
#include "soak_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::mapping_stage;
using flat = mapped_by<pinhole_camera>;
using traits = turbomap::map_traits<flat>;
using adjusted_run = mapping_run<flat, sequential_policy, turbomap::local_adjustment<flat, sequential_policy>>;

/// Few landmarks, and no keyframe is culled.
mapping_case<pinhole_camera> long_case() {
  mapping_recipe recipe = noisy(2);
  recipe.step = 0.5, recipe.per_metre = 8, recipe.clutter = 4;
  auto c = stereo_case(recipe);
  c.options.neighbours.neighbourhood.min_shared_points = 5;
  c.options.adjustment.min_shared_points = 5;
  c.options.adjustment.solve.max_iterations = 2;
  c.options.enabled[mapping_stage::keyframe_culling] = false;
  return c;
}
/// Room for so many keyframes of the scene, and a little more.
turbomap::keyframe_store_options room_for(std::size_t keyframes, double bytes_per_keyframe) {
  turbomap::keyframe_store_options o;
  o.chunk_bytes = static_cast<std::size_t>(1.25 * bytes_per_keyframe);  // one each
  o.byte_budget = keyframes * o.chunk_bytes;
  return o;
}
std::size_t most_observers(const flat& map) {
  std::size_t most = 0;
  traits::for_each_point(map, [&](turbomap::map_point_id p) {
    std::vector<std::int32_t> seen;
    for (const auto& o : map.observations(p)) seen.push_back(o.keyframe);
    std::sort(seen.begin(), seen.end());
    most = std::max(most, static_cast<std::size_t>(std::unique(seen.begin(), seen.end()) - seen.begin()));
  });
  return most;
}

TEST_CASE("350 keyframes in little memory: the same map as without a budget, and no iteration fails") {
  const auto c = long_case();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run free(scene, c.options);
  free.steps(10);
  const double bytes = free.store.statistics().bytes_per_keyframe;
  constexpr std::size_t room = 32;
  adjusted_run bound(scene, c.options, {}, sequential_policy(), room_for(room, bytes));
  bound.steps(10);
  std::size_t targets = 0, frames = 0;
  for (int n = 10; n < 350; ++n) {
    CAPTURE(n);
    REQUIRE_NOTHROW(bound.step());
    const auto& expected = free.step();
    REQUIRE(counts(bound.mapper.report()) == counts(expected));
    targets = std::max(targets, expected.fusion_targets);
    frames = std::max(frames, expected.adjustment.free_keyframes + expected.adjustment.fixed_keyframes);
  }
  CHECK(content(bound.map) == content(free.map));
  const auto statistics = bound.store.statistics();
  CHECK(statistics.keyframes == 350);
  CHECK(statistics.peak_chunk_bytes <= room * static_cast<std::size_t>(1.25 * bytes));
  CHECK(statistics.page_ins > 350);
  // What makes this hold: more keyframes were needed at once than fit, but not for one point.
  CAPTURE(targets);
  CAPTURE(frames);
  CHECK(std::max(targets, frames) > room);
  CHECK(most_observers(free.map) <= room);
}

TEST_CASE("with room for a keyframe and its neighbours only, points are described by the views that fit") {
  const auto c = long_case();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run free(scene, c.options);
  free.steps(30);
  adjusted_run bound(scene, c.options, {}, sequential_policy(),
                     room_for(11, free.store.statistics().bytes_per_keyframe));
  for (int n = 0; n < 30; ++n) {
    REQUIRE_NOTHROW(bound.step());
    REQUIRE(turbomap::validate(bound.map).empty());
  }
  CHECK(most_observers(bound.map) > 11);
  traits::for_each_point(bound.map, [&](turbomap::map_point_id p) { CHECK(traits::max_distance(bound.map, p) > 0); });
  check_good(bound.quality());
}

TEST_CASE("with no more room for long, and keyframes culled: no iteration fails") {
  auto c = long_case();
  c.options.enabled[mapping_stage::keyframe_culling] = true;
  c.options.keyframe_culling.redundant_share = 0.6F;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run free(scene, c.options);
  free.steps(30);
  adjusted_run bound(scene, c.options, {}, sequential_policy(),
                     room_for(11, free.store.statistics().bytes_per_keyframe));
  std::size_t culled = 0;
  for (int n = 0; n < 300; ++n) {
    CAPTURE(n);
    REQUIRE_NOTHROW(bound.step());
    CHECK(bound.mapper.report().refused.empty());
    culled += bound.mapper.report().keyframes_culled.size();
  }
  CHECK(turbomap::validate(bound.map).empty());
  CHECK(culled > 50);
  CHECK(bound.store.statistics().page_ins > 300);
}

TEST_CASE("a long run: the map does not grow, nothing is confused; from 3000 keyframes on, memory and time stay") {
  check_long_run(sequential_policy{});
}

}  // namespace
