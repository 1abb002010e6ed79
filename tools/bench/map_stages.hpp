// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stages of turbomap-bench that work on a map: fusion of duplicates, search by projection, update of map points, counting
/// for keyframe culling.
/// Each is compared with its oracle once: a stage that differs is not timed.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "reference/appearance_oracle.hpp"
#include "reference/culling_oracle.hpp"
#include "reference/projection_oracle.hpp"

#include <turbomap/map/neighbourhood.hpp>
#include <turbomap/mapping/duplicate_fusion.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>

#include "map_scene.hpp"
#include "measure.hpp"

namespace turbomap_bench {

/// What a stage has to do at least.
struct stage_floor {
  double distances = 0, transforms = 0, bytes = 0;

  double ms(double distance_ms) const {
    return distances * distance_ms + transform_floor_ms(transforms) + read_floor_ms(bytes);
  }
  nlohmann::json json() const { return {{"distances", distances}, {"transforms", transforms}, {"bytes", bytes}}; }
};

/// The query's points in its targets and theirs in it, searched and committed; each time on a map of its own.
template <class Policy>
nlohmann::json time_fusion(map_scene<Policy>& scene, int repetitions, double distance_ms) {
  using scene_type = map_scene<Policy>;
  using keyframe = typename scene_type::keyframe;
  turbomap::fusion_options options;
  options.search.scales = scene.update.scales;
  turbomap::neighbourhood<typename scene_type::map_type> around;
  const std::vector<keyframe> targets = around.targets(scene.map, scene.query(), {});
  const std::vector<turbomap_test::oracle_id> query{scene_type::traits::id(scene.map, scene.query())};
  std::vector<turbomap_test::oracle_id> target_ids;
  for (const keyframe k : targets) target_ids.push_back(scene_type::traits::id(scene.map, k));

  turbomap::duplicate_fusion<typename scene_type::map_type, Policy> fusion(scene.ctx);
  auto map = scene.map;
  turbomap::fusion_summary found;
  turbomap::guard_times unused;
  const auto ours = [&] {
    fusion.begin();
    const turbomap::span<const keyframe> all(targets);
    const turbomap::mapping_scope scope{scene.ctx, map, scene.store, scene.stored, unused};
    found = fusion.forward(scope, scene.query(), all, options);
    found += fusion.backward(scope, scene.query(), all, options);
  };
  auto expected = scene.oracle;
  const auto oracle = [&] {
    const auto& tolerance = options.commit.tolerance;
    const turbomap_test::oracle_merge_rule rule{false, true, tolerance.chi2,
                                                static_cast<double>(tolerance.scale_factor)};
    expected.pass(query, target_ids, false, options.search, rule);
    expected.pass(target_ids, query, false, options.search, rule);
  };
  ours();
  oracle();
  const auto& counts = expected.counts;
  require_same(found.entries == counts.entries && found.observations_added == counts.observations_added &&
                   found.merged == counts.merged && found.conflicts == counts.conflicts &&
                   map.point_count() == expected.map.points.size(),
               "fusion");

  // Every point into every camera that does not see it yet, and one comparison where something is found.
  stage_floor floor;
  floor.distances = static_cast<double>(counts.entries);
  std::set<turbomap_test::oracle_id> of_targets;
  const auto add_transforms = [&](turbomap_test::oracle_id point, turbomap_test::oracle_id target) {
    for (int camera = 0; camera < scene.oracle.keyframes.at(target).view.camera_count; ++camera)
      floor.transforms += scene.oracle.map.camera_sees(point, target, camera) ? 0 : 1;
  };
  for (const auto target : target_ids) {
    for (const auto point : scene.oracle.map.points_of(query[0])) add_transforms(point, target);
    for (const auto point : scene.oracle.map.points_of(target))
      if (of_targets.insert(point).second) add_transforms(point, query[0]);
  }
  auto result =
      interleave(repetitions, ours, oracle, floor.ms(distance_ms), [&] { map = scene.map, expected = scene.oracle; });
  result["floor"] = floor.json();
  result["targets"] = targets.size(), result["found"] = found.entries, result["merged"] = found.merged;
  return result;
}

/// The points of the query's neighbourhood in the query, as tracking looks for its local map in a frame.
template <class Policy>
nlohmann::json time_projection(map_scene<Policy>& scene, int repetitions, double distance_ms) {
  using scene_type = map_scene<Policy>;
  turbomap::neighbourhood<typename scene_type::map_type> around;
  turbomap::duplicate_snapshot<typename scene_type::map_type> local_map;
  for (const auto k : around.targets(scene.map, scene.query(), {})) local_map.add_points_of(scene.map, k);
  const auto points = local_map.points_view();
  turbomap::projection_options options;
  options.scales = scene.update.scales;

  using target = turbomap::projection_target<orb, fisheye>;
  using targets = turbomap::span<const target>;
  const auto& T_cw = scene.map.T_cw(scene.query());
  const turbomap::keyframe_handle handle = scene.stored.at(scene_type::traits::id(scene.map, scene.query()));
  const auto pinned = scene.store.pin(scene.ctx, turbomap::span<const turbomap::keyframe_handle>(&handle, 1));
  const target frame{pinned[0], T_cw};
  turbomap::projections<orb, fisheye, Policy> found(scene.ctx);
  typename turbomap::projections<orb, fisheye, Policy>::plan_type plan;
  const auto ours = [&] {
    turbomap::search_by_projection(scene.ctx, points, targets(&frame, 1), options, found);
    found.plan(scene.ctx, plan);
  };
  const target host_frame{scene.oracle.keyframes.at(scene_type::traits::id(scene.map, scene.query())).view, T_cw};
  std::vector<turbomap::projection_trial<std::int32_t>> expected;
  const auto oracle = [&] {
    expected.clear();
    for (const auto& t : turbomap_test::projection_oracle<orb, fisheye>(points, targets(&host_frame, 1), options))
      expected.push_back(t.trial);
    for (int c = 0; c < host_frame.view.camera_count; ++c)
      turbomap_test::settle_oracle(expected.data() + c * points.count, points.count);
  };
  ours();
  oracle();
  std::size_t matched = 0;
  for (const auto& t : expected) matched += t.outcome == turbomap::projection_outcome::matched ? 1 : 0;
  require_same(matched == plan.size(), "projection");
  for (const auto& m : plan)
    require_same(expected[static_cast<std::size_t>(m.camera * points.count + m.point)].keypoint == m.keypoint,
                 "projection");

  stage_floor floor;
  floor.distances = static_cast<double>(matched);
  floor.transforms = static_cast<double>(expected.size());
  auto result = interleave(repetitions, ours, oracle, floor.ms(distance_ms));
  result["floor"] = floor.json();
  result["points"] = points.count, result["found"] = matched;
  return result;
}

/// Descriptors, normals and ranges of the query's points: gathered, computed and written back; by definition they are
/// gathered and computed.
template <class Policy>
nlohmann::json time_map_update(map_scene<Policy>& scene, int repetitions, double distance_ms) {
  using scene_type = map_scene<Policy>;
  std::vector<typename scene_type::point> points;
  std::vector<std::uint64_t> ids;
  stage_floor floor;
  for (const std::uint64_t id : scene.oracle.map.points_of(scene_type::traits::id(scene.map, scene.query()))) {
    points.push_back(scene.points.at(id)), ids.push_back(id);
    const auto n = static_cast<double>(scene.oracle.map.points.at(id).views.size());
    floor.distances += n * (n - 1) / 2;
  }
  turbomap::guard_times unused;
  const auto ours = [&] {
    scene.appearance({scene.ctx, scene.map, scene.store, scene.stored, unused}, points, scene.update);
  };
  std::vector<posed> keyframes;  // all are alive: their ids are their numbers
  for (const auto& [unused_id, k] : scene.oracle.keyframes) keyframes.push_back(k);
  std::vector<turbomap::point_appearance> expected;
  const auto oracle = [&] {
    std::vector<turbomap::vec3<double>> positions;
    std::vector<std::int32_t> offsets{0}, references;
    std::vector<turbomap::point_observation> views;
    for (const std::uint64_t id : ids) {
      positions.push_back(scene_type::traits::position(scene.map, scene.points.at(id)));
      const auto& p = scene.oracle.map.points.at(id);
      references.push_back(static_cast<std::int32_t>(*p.reference));
      for (const auto& [k, i] : p.views) views.push_back({static_cast<std::int32_t>(k), static_cast<std::int32_t>(i)});
      offsets.push_back(static_cast<std::int32_t>(views.size()));
    }
    const turbomap::appearance_view view{static_cast<int>(ids.size()), positions.data(), offsets.data(), views.data(),
                                         references.data()};
    expected = turbomap_test::appearance_oracle(view, keyframes, scene.update);
  };
  ours();
  oracle();
  bool same = true;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    auto v = scene.oracle.map.points.at(ids[i]).views.begin();
    std::advance(v, expected[i].medoid);
    const auto* medoid = scene.oracle.keyframes.at(v->first).view.descriptor_of(static_cast<int>(v->second));
    same = same && std::memcmp(medoid, scene_type::traits::descriptor_data(scene.map, points[i]), orb::bytes) == 0;
  }
  require_same(same, "map_update");
  auto result = interleave(repetitions, ours, oracle, floor.ms(distance_ms));
  result["floor"] = floor.json();
  return result;
}

/// The redundant points of twenty covisible keyframes are counted; none is taken out. On the host under every policy.
template <class Policy>
nlohmann::json time_culling(map_scene<Policy>& scene, int repetitions, double distance_ms) {
  using scene_type = map_scene<Policy>;
  using keyframe = typename scene_type::keyframe;
  constexpr std::size_t candidate_count = 20;
  turbomap::neighbourhood<typename scene_type::map_type> around;
  std::vector<keyframe> candidates;
  std::vector<turbomap_test::oracle_id> ids;
  stage_floor floor;
  for (const keyframe k : around.covisible_keyframes(scene.map, scene.query(), {})) {
    const std::uint64_t id = scene_type::traits::id(scene.map, k);
    if (candidates.size() == candidate_count || !scene_type::traits::may_erase(scene.map, k)) continue;
    candidates.push_back(k), ids.push_back(id);
    // A slot per keypoint, and the counts of each point.
    floor.bytes += static_cast<double>(sizeof(std::int32_t) * scene.map.keypoints(k).size() +
                                       sizeof(std::uint32_t) * scene.oracle.map.points_of(id).size() *
                                           static_cast<std::size_t>(scene.map.levels()));
  }
  turbomap::keyframe_culling_options options;
  options.redundant_share = 1;  // more than all of them: never
  turbomap_test::oracle_culling_rules rules;
  rules.share = 1;
  std::vector<turbomap::redundancy> counts;
  // Their keypoints are known from a call before. In the stage, those of a new candidate are not.
  turbomap::handle_table stored;
  for (std::size_t i = 0; i < ids.size(); ++i) stored.add(ids[i], {static_cast<std::uint32_t>(i), 1});
  turbomap::redundancy_counter<typename scene_type::map_type> counter;
  counter.remember_by(&stored);
  const auto ours = [&] {
    counts.clear(), counter.clear();
    for (const keyframe k : candidates) counts.push_back(counter(scene.map, k, options));
  };
  std::vector<turbomap_test::oracle_culled> expected;
  const auto oracle = [&] {
    std::multiset<turbomap_test::oracle_id> unused;
    expected = cull_keyframes_by_definition(scene.oracle.map, scene_type::traits::id(scene.map, scene.query()), ids,
                                            rules, unused);
  };
  ours();
  oracle();
  bool same = counts.size() == expected.size();
  for (std::size_t i = 0; same && i < counts.size(); ++i)
    same = counts[i].points == expected[i].points && counts[i].redundant == expected[i].redundant;
  require_same(same, "culling");
  auto result = interleave(repetitions, ours, oracle, floor.ms(distance_ms));
  result["floor"] = floor.json();
  result["keyframes"] = candidates.size();
  return result;
}

/// \param distance_ms  of one descriptor distance in a stream
template <class Policy>
void run_map_stages(turbomap::context<Policy>& ctx, const turbomap::recording& recording, int repetitions,
                    double distance_ms, nlohmann::json& stages) {
  map_scene<Policy> scene(ctx, recording);
  stages["fusion"] = time_fusion(scene, repetitions, distance_ms);
  stages["projection"] = time_projection(scene, repetitions, distance_ms);
  stages["map_update"] = time_map_update(scene, repetitions, distance_ms);
  stages["culling"] = time_culling(scene, repetitions, distance_ms);
}

}  // namespace turbomap_bench
