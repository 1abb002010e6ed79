// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Replays that are tracked by projection, and the judge of points: both by the simulator's ids.

#include "replay/loop.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <doctest/doctest.h>
#include <thrust/execution_policy.h>

#include "support/policies.hpp"

namespace {

namespace sim = turbomap::simulation;
using turbomap::mapping_stage;
using turbomap::recording;
using turbomap_replay::orb;
using turbomap_replay::replay_result;

recording simulated(const sim::simulated_rig& rig) {
  sim::simulation_options options;
  options.motion.most_keyframes = 10;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

template <class Camera, class Policy>
replay_result replay(const recording& r, const Policy& policy, bool projected, bool adjustment = true) {
  turbomap_replay::arguments arguments;
  arguments.projected = projected, arguments.adjustment = adjustment;
  return turbomap_replay::replayer<turbomap::simple_map<orb, Camera>, Policy>(r, policy, arguments).run();
}

template <class Camera>
void check_projected(const recording& r) {
  const auto recorded = replay<Camera>(r, thrust::seq, false), projected = replay<Camera>(r, thrust::seq, true);
  CHECK(recorded.projected == 0);
  CHECK(projected.projected > 300);
  CHECK(projected.projected_kept <= projected.projected);
  CHECK(static_cast<double>(projected.projected_kept_right) > 0.9 * static_cast<double>(projected.projected_kept));
  CHECK(projected.faults == 0);
  CHECK(projected.map_digest != recorded.map_digest);
  // What is tracked need not be found as a duplicate.
  CHECK(projected.true_points.merged < recorded.true_points.merged);
  CHECK(projected.true_points.created > 100);
  CHECK(projected.true_points.points == projected.points.size());
}

TEST_CASE("the local map is found by projection, and most of it rightly") {
  check_projected<turbomap::pinhole<float>>(simulated(sim::euroc_rig()));
  check_projected<turbomap::kannala_brandt<float>>(simulated(sim::tum_vi_rig()));
}

TEST_CASE("the same map under every policy") {
  const recording r = simulated(sim::euroc_rig());
  using camera = turbomap::pinhole<float>;
  const auto expected = replay<camera>(r, thrust::seq, true, false);
  turbomap_test::for_each_parallel_policy([&](auto policy) {
    const auto found = replay<camera>(r, policy, true, false);
    CHECK(found.map_digest == expected.map_digest);
    CHECK(found.projected == expected.projected);
  });
}

/// Keyframes of four keypoints; `sim_point_id` is what they show.
struct by_hand {
  using map_type = turbomap::simple_map<orb, turbomap::pinhole<float>>;
  recording truth;
  map_type map;
  std::vector<turbomap::map_keyframe_id> keyframes;
  turbomap_replay::points_judge<map_type> judge{truth};

  explicit by_hand(std::vector<std::int32_t> ids) {
    truth.sim_point_id = std::move(ids);
    const std::vector<turbomap::keypoint> keypoints(4);
    for (std::size_t i = 0; i <= truth.sim_point_id.size() / 4; ++i) {
      truth.kp_off.push_back(static_cast<std::int64_t>(4 * i));
      if (i < truth.sim_point_id.size() / 4) keyframes.push_back(map.add_keyframe(keypoints, {}));
    }
  }
  /// A point that keypoint `at` of every keyframe shows, as far as it is free.
  turbomap::map_point_id add(std::size_t at, std::vector<std::size_t> views) {
    const auto p = map.add_point({0, 0, 1});
    for (const std::size_t k : views) turbomap::observe(map, p, keyframes[k], at);
    return p;
  }
};

TEST_CASE("points, merges and observations are judged by what their keypoints show") {
  by_hand h({7, 8, 9, -1,  //
             7, 8, 5, -1,  //
             7, 7, 5, 9});
  const auto a = h.add(0, {0, 1});  // there before
  h.judge.stage_done(h.map, h.keyframes[2], mapping_stage::search);
  h.add(0, {2});                             // 7, right
  const auto c = h.add(1, {0, 1, 2});        // 8, 8, 7: wrong
  const auto d = h.add(2, {1, 2});           // 5, right
  const auto clutter = h.add(3, {0, 1, 2});  // wrong
  h.judge.stage_done(h.map, h.keyframes[2], mapping_stage::creation);
  auto v = h.judge.verdict(h.map);
  CHECK(v.created == 4);
  CHECK(v.created_wrong == 2);
  CHECK(v.points == 5);
  CHECK(v.points_wrong == 2);
  CHECK(v.points_duplicate == 1);  // 7 has two
  CHECK(v.observations == 11);
  CHECK(v.observations_wrong == 4);
  CHECK(h.judge.truth(h.map, c) == 8);
  CHECK(h.judge.truth(h.map, a, h.keyframes[0]) == 7);
  CHECK(h.judge.truth(h.map, clutter) == -1);

  std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch;
  turbomap::erase_point(h.map, clutter);  // no merge
  CHECK(turbomap::merge_points(h.map, h.map.point_at(h.keyframes[2], 0), a, turbomap::merge_rule::refuse, scratch));
  CHECK(turbomap::merge_points(h.map, d, c, turbomap::merge_rule::drop, scratch));
  h.judge.stage_done(h.map, h.keyframes[2], mapping_stage::fusion);
  v = h.judge.verdict(h.map);
  CHECK(v.merged == 2);
  CHECK(v.merged_wrong == 1);
  CHECK(v.points == 2);
  CHECK(v.points_duplicate == 0);
}

TEST_CASE("times for which the guard was held since some that were noted") {
  turbomap::guard_times before, later;
  before.add(4), before.add(0.1);
  later.add(0.5), later.add(2, true);
  turbomap::guard_times all = before;
  all += later;
  const turbomap::guard_times found = turbomap_replay::since(before, all);
  CHECK(found.count == 2);
  CHECK(found.total_ms == doctest::Approx(2.5));
  CHECK(found.commit_ms == doctest::Approx(2));
  CHECK(found.over_1_ms == 1);
  CHECK(found.quantile(0) == doctest::Approx(later.quantile(0)));
  CHECK(found.longest_ms >= 2);  // 4 is not of these
  CHECK(found.longest_ms <= 2.25);
  all.add(8);
  CHECK(turbomap_replay::since(before, all).longest_ms == 8);
}

}  // namespace
