// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Duplicate fusion on whole maps against its sequential oracle, for every execution policy, host or device.

#include <turbomap/map/neighbourhood.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/duplicate_fusion.hpp>

#include <cmath>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "scenes/oracle_world.hpp"

namespace turbomap_test {

/// Who sees what is equal; descriptors are; normals and ranges are as near as float.
template <class Map, class Oracle>
void check_equal(const Map& map, const Oracle& oracle) {
  using traits = turbomap::map_traits<Map>;
  std::size_t points = 0, slots = 0, differences = 0, far = 0;
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) {
      const auto p = traits::point_at(map, k, i);
      const auto expected = oracle.map.point_at({traits::id(map, k), i});
      const bool there = p != typename traits::point{};
      differences += there == expected.has_value() && (!there || traits::id(map, p) == *expected) ? 0 : 1;
      slots += there ? 1 : 0;
    }
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    ++points;
    const auto found = oracle.appearance.find(traits::id(map, p));
    REQUIRE(found != oracle.appearance.end());
    const auto& a = found->second;
    for (int e = 0; e < traits::descriptor::elements; ++e)
      differences += traits::descriptor_data(map, p)[e] == a.descriptor[static_cast<std::size_t>(e)] ? 0 : 1;
    const auto& n = traits::normal(map, p);
    const float values[][2] = {{n.x, a.normal.x},
                               {n.y, a.normal.y},
                               {n.z, a.normal.z},
                               {traits::min_distance(map, p), a.min_distance},
                               {traits::max_distance(map, p), a.max_distance}};
    for (const auto& v : values) far += std::abs(v[0] - v[1]) <= 1e-6F * (1 + std::abs(v[1])) ? 0 : 1;
  });
  CHECK(points == oracle.map.points.size());
  CHECK(slots > 0);
  CHECK(differences == 0);
  CHECK(far == 0);
}

struct fusion_tally {
  std::size_t scenes = 0, merged = 0, added = 0, conflicts = 0, already = 0;
};

/// Both passes and the update after them, on the last keyframe of a map, in the library and by the oracle.
template <class Camera, class Policy>
void check_fusion(const Policy& policy, const test_rig<Camera>& rig, const mapping_recipe& recipe,
                  turbomap::fusion_mode mode, turbomap::merge_rule merges, fusion_tally& tally, int keyframes = 7) {
  const mapping_scene<Camera> scene(rig, recipe);
  mapping_run<mapped<Camera>, Policy> run(scene, unfused(recipe.scales), {}, policy);
  run.steps(keyframes);
  oracle_world<Camera> world(scene, run);
  auto& oracle = world.oracle;
  using traits = turbomap::map_traits<mapped<Camera>>;
  const auto query = run.keyframes().back();
  turbomap::neighbourhood<mapped<Camera>> around;
  const auto targets = around.targets(run.map, query, {});
  REQUIRE(targets.size() >= 3);
  std::vector<oracle_id> target_ids;
  for (const auto k : targets) target_ids.push_back(traits::id(run.map, k));
  const oracle_id query_id = traits::id(run.map, query);

  turbomap::fusion_options options;
  options.mode = mode, options.commit.merges = merges;
  options.search.scales = recipe.scales;
  const bool serial = mode == turbomap::fusion_mode::serial_exact;
  const oracle_merge_rule rule{merges == turbomap::merge_rule::drop, merges == turbomap::merge_rule::refuse_apart};
  oracle.pass({query_id}, target_ids, serial, options.search, rule);
  oracle.pass(target_ids, {query_id}, serial, options.search, rule);
  oracle.refresh(oracle.touched, recipe.scales);
  ++tally.scenes;

  turbomap::duplicate_fusion<mapped<Camera>, Policy> fusion(run.ctx);
  turbomap::guard_times held;
  fusion.begin();
  const auto span = turbomap::span<const turbomap::map_keyframe_id>(targets);
  auto summary = fusion.forward(run.scope(held), query, span, options);
  summary += fusion.backward(run.scope(held), query, span, options);
  turbomap::appearance_update<mapped<Camera>, Policy> update(run.ctx);
  turbomap::appearance_options appearance;
  appearance.scales = recipe.scales;
  const std::size_t updated = update(run.scope(held), fusion.touched(), appearance);
  std::set<oracle_id> gained;
  for (const oracle_id p : oracle.touched)
    if (oracle.map.points.count(p) != 0) gained.insert(p);
  CHECK(updated == gained.size());
  CHECK(summary.entries == oracle.counts.entries);
  CHECK(summary.observations_added == oracle.counts.observations_added);
  CHECK(summary.merged == oracle.counts.merged);
  CHECK(summary.already_observed == oracle.counts.already_observed);
  CHECK(summary.conflicts == oracle.counts.conflicts);
  CHECK(summary.stale == oracle.counts.stale);
  check_equal(run.map, oracle);
  CHECK(turbomap::validate(run.map).empty());
  CHECK(held.count >= 4);
  tally.merged += summary.merged, tally.added += summary.observations_added;
  tally.conflicts += summary.conflicts, tally.already += summary.already_observed;
}

/// Noisy scenes of one kind, in all modes and under all merge rules.
template <class Camera, class Policy>
fusion_tally check_fusions(const Policy& policy, const test_rig<Camera>& rig, unsigned seed, int scenes = 2) {
  fusion_tally tally;
  for (int i = 0; i < scenes; ++i)
    for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact})
      for (const auto merges :
           {turbomap::merge_rule::refuse_apart, turbomap::merge_rule::refuse, turbomap::merge_rule::drop}) {
        mapping_recipe recipe;
        recipe.seed = seed++, recipe.pixel_noise = 0.4, recipe.noisy_bits = 30, recipe.twins = 0.3;
        recipe.lost = 0.6, recipe.fresh = 0.6, recipe.step = 0.4;
        recipe.scales.levels = 8;
        check_fusion(policy, rig, recipe, mode, merges, tally);
      }
  CHECK(tally.merged > 50);
  CHECK(tally.added > 50);
  CHECK(tally.already > 0);
  return tally;
}

}  // namespace turbomap_test
