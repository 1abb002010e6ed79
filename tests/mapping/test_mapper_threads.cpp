// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Commits in parts: the same map whatever the size of a part, and nothing is written once somebody else has moved what a
/// result was computed from. And mapper, tracking and loop closing on one map in three threads (mapper_threads_cases.hpp).

#include <thrust/execution_policy.h>

#include <algorithm>
#include <string>

#include "local_mapper_cases.hpp"
#include "mapper_threads_cases.hpp"
#include "scenes/watched_map.hpp"

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

TEST_CASE("somebody moves the map between two parts of creation: no more points enter") {
  for (const int part : {1, 2, 5, 1000}) {
    CAPTURE(part);
    auto c = stereo_case(noisy(4, 1.2));
    c.options.points_read_per_guard = 4;  // so that a part is one new point
    bool armed = false, creating = false;
    int times = 0;
    std::size_t created = 0;
    turbomap::local_mapper_hooks<watched> hooks;
    hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report& report) {
      if (s == mapping_stage::search) creating = armed, times = 0;
      if (s == mapping_stage::creation) creating = false, created = report.points_created;
    };
    const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
    run_type run(scene, c.options, hooks);
    run.steps(6);
    armed = true;
    run.map.watch.before = [&] {
      if (creating && ++times == part) move_all(run.map, 0.25);
    };
    run.step();
    run.map.watch.before = {};
    if (part < 1000) {
      CHECK(created <= static_cast<std::size_t>(part - 1));
      CHECK((part < 5 || created > 1));  // a part's point may have lost its keypoints
      CHECK(times == part);              // it looked, and stopped
    } else {
      CHECK(created > 4);
      CHECK(times > 4);
    }
    CHECK(turbomap::validate(run.map).empty());
  }
}

template <class Map>
void check_threads(told by = told::by_keyframes) {
  auto c = stereo_case(noisy(3));
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>> run(
      scene, in_small_parts(c.options), {}, sequential_policy(), little_memory());
  mapper_threads(scene, run, camera_alone{}, by).check(12);
}

TEST_CASE("mapper, tracking and loop closing on one map") { check_threads<watched>(); }
TEST_CASE("the same where the mapper works on a mirror, which is told of all that loop closing does") {
  check_threads<mirrored_watched_map>(told::by_keyframes);
  check_threads<mirrored_watched_map>(told::by_points);
}

}  // namespace
