// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A system that is recorded through its map_traits while it runs: what is written is what the map held before each process().

#include <turbomap/io/map_recorder.hpp>

#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "mapping/local_mapper_cases.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/recording_samples.hpp"
#include "support/files.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using traits = turbomap::map_traits<flat_map>;

turbomap::recording_meta stereo_meta() {
  auto meta = small_meta(false);
  meta.sensor = "stereo";
  meta.events.clear(), meta.snapshots.clear();
  return meta;
}

TEST_CASE("associations are named by the first and the last keyframe that saw the point before") {
  const auto c = stereo_case(noisy(3));
  const mapping_scene<pinhole_camera> scene(c.rig, noisy(3));
  mapping_run<flat_map, sequential> run(scene, c.options);
  turbomap::map_recorder<flat_map> recorder(stereo_meta());
  std::map<std::uint64_t, std::int32_t> index;  // by id of the keyframe
  std::size_t rows = 0, fresh = 0, culled = 0;
  for (std::int32_t n = 0; n < 12; ++n) {
    const auto k = run.track();
    const auto data = scene.data<traits::descriptor>(run.view(static_cast<std::size_t>(n)));
    CHECK(recorder.add(run.map, k, data, 100 * n) == n);
    const turbomap::recording& r = recorder.get().data();
    // The truth, from the map.
    std::size_t row = r.associations(static_cast<std::size_t>(n)).begin;
    for (std::size_t i = 0; i < traits::keypoint_count(run.map, k); ++i) {
      const auto p = traits::point_at(run.map, k, i);
      if (p == turbomap::map_point_id{}) continue;
      std::set<std::pair<std::int32_t, std::int32_t>> before;
      traits::for_each_observation(run.map, p, [&](turbomap::map_keyframe_id o, std::size_t at) {
        if (o != k) before.insert({index.at(traits::id(run.map, o)), static_cast<std::int32_t>(at)});
      });
      REQUIRE(row < r.assoc_kp.size());
      CHECK(r.assoc_kp[row] == static_cast<std::int32_t>(i));
      CHECK(r.assoc_new[row] == (before.empty() ? 1 : 0));
      const auto own = std::make_pair(n, static_cast<std::int32_t>(i));
      CHECK(std::make_pair(r.assoc_ref[row].keyframe, r.assoc_ref[row].keypoint) ==
            (before.empty() ? own : *before.rbegin()));
      CHECK(std::make_pair(r.assoc_ref2[row].keyframe, r.assoc_ref2[row].keypoint) ==
            (before.empty() ? own : *before.begin()));
      fresh += before.empty() ? 1 : 0;
      ++row;
    }
    CHECK(row == r.assoc_kp.size());
    rows = row;
    index[traits::id(run.map, k)] = n;
    culled += run.mapper.process(k).keyframes_culled.size();
  }
  CHECK(rows > fresh);
  CHECK(fresh > 0);
  CHECK(culled > 0);  // so that indices are not ids

  const temporary_directory folder;
  recorder.write(folder / "r");
  const auto back = turbomap::read_recording(folder / "r");
  CHECK(back.keyframe_count() == 12);
  CHECK(back.assoc_kp.size() == rows);
  CHECK(back.gather_keypoints(3).size() == run.view(3).keypoints.size());
  CHECK(back.prev_kf[5] == 4);
}

TEST_CASE("a recording with an IMU is refused, since no states would be in it") {
  auto meta = stereo_meta();
  meta.sensor = "inertial";
  CHECK_THROWS_AS(turbomap::map_recorder<flat_map>{meta}, std::invalid_argument);
}

TEST_CASE("what is refused is not recorded, and may be recorded later") {
  const auto c = stereo_case(noisy(3));
  const mapping_scene<pinhole_camera> scene(c.rig, noisy(3));
  mapping_run<flat_map, sequential> run(scene, c.options);
  turbomap::map_recorder<flat_map> recorder(stereo_meta());
  const auto k = run.track();
  auto data = scene.data<traits::descriptor>(run.view(0));
  auto less = data;
  --less.keypoint_count;
  CHECK_THROWS_AS(recorder.add(run.map, k, less, 0), std::invalid_argument);
  auto missing = data;
  missing.keypoints = nullptr;
  CHECK_THROWS_WITH_AS(recorder.add(run.map, k, missing, 0), doctest::Contains("data.keypoints"),
                       std::invalid_argument);
  missing = data, missing.descriptors = nullptr;
  CHECK_THROWS_WITH_AS(recorder.add(run.map, k, missing, 0), doctest::Contains("data.descriptors"),
                       std::invalid_argument);
  const std::vector<turbomap::recorded_recent_point> later{{{7, 0}, 0, 1, 1}};
  CHECK_THROWS_AS(recorder.add(run.map, k, data, 0, later), std::invalid_argument);
  CHECK(recorder.get().data().keyframe_count() == 0);
  CHECK(recorder.add(run.map, k, data, 0) == 0);
  CHECK_THROWS_AS(recorder.add(run.map, k, data, 1), std::invalid_argument);  // twice
  CHECK(recorder.get().data().keyframe_count() == 1);
}

TEST_CASE("what was recorded is taken, and the next recording names its own keyframes only") {
  const auto c = stereo_case(noisy(3));
  const mapping_scene<pinhole_camera> scene(c.rig, noisy(3));
  mapping_run<flat_map, sequential> run(scene, c.options);
  turbomap::map_recorder<flat_map> recorder(stereo_meta());
  std::size_t known = 0;
  for (std::int32_t n = 0; n < 6; ++n) {
    const auto k = run.track();
    const auto data = scene.data<traits::descriptor>(run.view(static_cast<std::size_t>(n)));
    if (n == 3) {
      const turbomap::recording taken = std::move(recorder.get().data());
      CHECK(taken.keyframe_count() == 3);
      recorder.get().data().meta = stereo_meta();
    }
    REQUIRE(recorder.add(run.map, k, data, 100 * n) == n % 3);
    const turbomap::recording& r = recorder.get().data();
    for (std::size_t row = r.associations(static_cast<std::size_t>(n % 3)).begin; row < r.assoc_kp.size(); ++row) {
      known += r.assoc_new[row] == 0 ? 1 : 0;
      if (n == 3) CHECK(r.assoc_new[row] == 1);
    }
    run.mapper.process(k);
  }
  CHECK(known > 0);
}

}  // namespace
