// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Commits in parts: the same map whatever the size of a part, and nothing is written once somebody else has moved what a
/// result was computed from. And mapper, tracking and loop closing on one map in three threads; made for the thread sanitizer.
/// TURBOMAP_TEST_SECONDS in the environment lets the threads run for longer than two seconds.

#include <thrust/execution_policy.h>

#include <atomic>
#include <chrono>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "local_mapper_cases.hpp"
#include "scenes/watched_map.hpp"
#include "support/environment.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::mapping_stage;
using turbomap::stage_outcome;
using watched = watched_map<turbomap::binary_descriptor<256>>;
using traits = turbomap::map_traits<watched>;
using run_type = mapping_run<watched, sequential_policy, turbomap::local_adjustment<watched, sequential_policy>>;

TEST_CASE("the map is the same whatever the size of a part") {
  std::string expected;
  for (const int part : {0, 1, 7, 1000}) {
    CAPTURE(part);
    auto c = stereo_case(noisy(4, 1.2));
    c.options.fusion.commit.entries_per_guard = part;
    c.options.adjustment.points_per_guard = part;
    c.options.points_read_per_guard = part;
    const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
    run_type run(scene, c.options);
    std::size_t merged = 0, outliers = 0, most = 0;
    for (int n = 0; n < 10; ++n) {
      const auto& report = run.step();
      merged += report.fused.merged, outliers += report.adjustment.outliers;
      most = std::max(most, report.held[mapping_stage::adjustment].count);
    }
    CHECK(merged > 20);
    CHECK(outliers > 10);
    CHECK((part != 1 || most > 50));
    if (part == 0) expected = content(run.map);
    CHECK(content(run.map) == expected);
  }
}

TEST_CASE("somebody moves the map between two parts: the rest is not written") {
  for (const bool erase : {false, true}) {
    int checked = 0;
    for (int at = 1; at < 40; at += 3) {
      CAPTURE(erase);
      CAPTURE(at);
      auto c = stereo_case(noisy(4));
      c.options.adjustment.points_per_guard = 16;
      c.options.enabled[mapping_stage::keyframe_culling] = false;
      std::string left;
      watched* map = nullptr;
      int times = -1;  // since adjustment began
      turbomap::local_mapper_hooks<watched> hooks;
      hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report& report) {
        if (s == mapping_stage::fusion && times == -1 && map != nullptr) times = 0;
        if (s != mapping_stage::adjustment || times < 0) return;
        if (times > at && at > 0) {
          CHECK(content(*map) == left);
          CHECK(report.adjustment.stale == (times == at + 1));
          ++checked;
        }
        times = -2;
      };
      const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
      run_type run(scene, c.options, hooks);
      run.steps(6);
      map = &run.map;
      run.map.watch.after = [&] {
        if (times < 0 || times++ != at) return;
        if (erase)
          turbomap::erase_keyframe(run.map, run.keyframes()[4]);
        else
          move_all(run.map, 0.25);
        left = content(run.map);
      };
      run.step();
      run.map.watch.after = {};
      CHECK(turbomap::validate(run.map).empty());
    }
    CHECK(checked > 3);  // later, adjustment is over
  }
}

TEST_CASE("mapper, tracking and loop closing on one map") {
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::seconds(static_cast<long>(environment("TURBOMAP_TEST_SECONDS", 2)));
  auto c = stereo_case(noisy(3));
  c.options.fusion.commit.entries_per_guard = 8;
  c.options.adjustment.points_per_guard = 64;
  c.options.points_read_per_guard = 64;  // so keyframes are culled in parts too
  c.options.adjustment.solve.max_iterations = 3;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  run_type run(scene, c.options, {}, sequential_policy(), [] {
    turbomap::keyframe_store_options o;
    o.chunk_bytes = std::size_t{1} << 16, o.byte_budget = std::size_t{3} << 20;
    return o;
  }());
  run.notes_creation = false;
  auto& map = run.map;
  std::atomic<bool> done{false};
  std::atomic<long> reads{0}, moves{0};

  // Reads the newest keyframes and their points, and searches the newest keyframes in the store.
  std::vector<turbomap::keyframe_handle> newest;  // under the guard
  std::thread tracking([&] {
    turbomap::context<sequential_policy> ctx;
    double sum = 0;
    while (!done) {
      std::vector<turbomap::keyframe_handle> handles;
      {
        const auto guard = turbomap::map_guard(map);
        handles = newest;
        traits::for_each_point(map, [&](turbomap::map_point_id p) {
          sum += traits::position(map, p).x + traits::max_distance(map, p) + traits::descriptor_data(map, p)[0];
          traits::for_each_observation(
              map, p, [&](turbomap::map_keyframe_id k, std::size_t) { sum += traits::pose(map, k).tx; });
        });
      }
      try {
        const auto pinned =
            run.store.pin(ctx, turbomap::span<const turbomap::keyframe_handle>(handles.data(), handles.size()));
        for (std::size_t i = 0; i < handles.size(); ++i)
          for (int k = 0; k < pinned[i].keypoint_count; ++k)
            sum += pinned[i].descriptor_of(k)[0] + pinned[i].pixel[k].x;
      } catch (const turbomap::stale_handle&) {  // culled since
      }
      ++reads;
      std::this_thread::yield();
    }
    CHECK(std::isfinite(sum));
  });
  // Moves the whole map, merges and erases.
  std::thread loop_closing([&] {
    std::mt19937 random(11);
    std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch;
    std::vector<turbomap::map_point_id> points;
    while (!done) {
      {
        const auto guard = turbomap::map_guard(map);
        if (random() % 4 == 0) move_all(map, random() % 2 == 0 ? 1e-3 : -1e-3), ++moves;
        points.clear();
        traits::for_each_point(map, [&](turbomap::map_point_id p) { points.push_back(p); });
        for (int n = 0; n < 3 && points.size() > 10; ++n) {
          const auto p = points[random() % points.size()], q = points[random() % points.size()];
          if (!map.alive(p) || !map.alive(q)) continue;
          if (random() % 4 == 0)
            turbomap::erase_point(map, p);
          else
            turbomap::merge_points(map, p, q, turbomap::merge_rule::refuse, scratch);
        }
      }
      std::this_thread::yield();
    }
  });
  std::size_t matches = 0, accepted = 0, stale = 0;
  int keyframes = 0;
  for (; keyframes < 12 || std::chrono::steady_clock::now() < end; ++keyframes) {
    turbomap::map_keyframe_id k;
    {
      const auto guard = turbomap::map_guard(map);
      k = run.add();
    }
    const auto& view = run.view(run.keyframes().size() - 1);
    run.mapper.insert(k, scene.data<turbomap::binary_descriptor<256>>(view));  // takes the guard itself
    {
      const auto guard = turbomap::map_guard(map);
      run.associate(k, view);
      newest.clear();
      for (std::size_t i = run.keyframes().size(); i-- > 0 && newest.size() < 3;) {
        turbomap::keyframe_handle handle;
        if (map.alive(run.keyframes()[i]) && run.mapper.stored().find(traits::id(map, run.keyframes()[i]), handle))
          newest.push_back(handle);
      }
    }
    const auto& report = run.mapper.process(k);
    matches += report.matches, accepted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    stale += report.adjustment.stale ? 1 : 0;
    CHECK(report.refused.empty());
    const auto guard = turbomap::map_guard(map);
    REQUIRE(turbomap::validate(map).empty());
  }
  done = true;
  tracking.join(), loop_closing.join();
  CAPTURE(keyframes);
  CAPTURE(stale);
  CHECK(reads > 5);
  CHECK(moves > 3);
  CHECK(matches > 0);  // a move before the commit keeps points from being made of them
  CHECK(accepted > 0);
  CHECK(turbomap::validate(map).empty());
  CHECK(run.store.statistics().pinned_sets == 0);
}

}  // namespace
