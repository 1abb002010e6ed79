// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// All recordings that are there are read and hold what their meta.json says.

#include <turbomap/io/recording.hpp>
#include <turbomap/io/recording_writer.hpp>
#include <turbomap/io/trajectory_error.hpp>
#include "readers/recording_snapshot.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "support/files.hpp"
#include "support/support.hpp"

TEST_CASE("recorded runs are read, and hold what they say") {
  const auto folder = turbomap_test::data("recordings");
  if (!folder) return;
  std::size_t runs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(*folder)) {
    if (!entry.is_directory()) continue;
    CAPTURE(entry.path().string());
    ++runs;
    const auto start = std::chrono::steady_clock::now();
    const turbomap::recording r = turbomap::read_recording(entry.path());
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    MESSAGE(entry.path().filename().string() << ": read in " << 1000 * seconds << " ms");
    CHECK(r.meta.keyframes_inserted == static_cast<int>(r.keyframe_count()));
    CHECK(r.meta.keyframes_alive_end == std::count(r.final_alive.begin(), r.final_alive.end(), 1));
    CHECK(r.meta.frames == static_cast<int>(r.frame_state.size()));
    CHECK(r.meta.frames_not_ok ==
          std::count_if(r.frame_state.begin(), r.frame_state.end(), [](auto s) { return s != 2; }));
    CHECK(r.has_velocity() == (r.meta.sensor == "inertial"));
    CHECK(r.meta.is_fisheye() == (r.nleft[0] >= 0));
    for (std::size_t i = 0; i < r.keyframe_count(); ++i) {
      const auto keypoints = r.gather_keypoints(i);
      CHECK(std::is_sorted(keypoints.begin(), keypoints.end(), [](auto& a, auto& b) { return a.camera < b.camera; }));
      if (r.nleft[i] >= 0)
        CHECK(std::count_if(keypoints.begin(), keypoints.end(), [](auto& k) { return k.camera == 0; }) == r.nleft[i]);
    }
    // The recorded system's own figure, from its final poses.
    CHECK(turbomap::keyframe_trajectory_error(r, r.final_T_cw, r.final_alive) ==
          doctest::Approx(r.meta.ate_kf_rmse_m).epsilon(1e-3));

    const auto timing = turbomap::read_timing(entry.path());
    REQUIRE(timing.row_count() == r.keyframe_count());
    const auto &pairs = timing.column("n_pairs"), &count = timing.column("n_kp");
    for (std::size_t i = 0; i < r.keyframe_count(); ++i) CHECK(count[i] == static_cast<double>(r.keypoints(i).size()));
    for (const auto iteration : r.meta.snapshots) {
      CAPTURE(iteration);
      const auto s = turbomap::read_snapshot(r, entry.path(), iteration);
      CHECK(s.iteration == iteration);
      CHECK(static_cast<double>(s.search.pairs.size()) == pairs[static_cast<std::size_t>(iteration)]);
      CHECK(std::count(s.kf_alive.begin(), s.kf_alive.end(), s.keyframe) == 1);
    }
  }
  CHECK(runs >= 4);
}

TEST_CASE("a recorded run is written and read back the same") {
  const auto folder = turbomap_test::data("recordings/euroc_v102_stereo");
  if (!folder) return;
  const turbomap_test::temporary_directory copy;
  const turbomap::recording r = turbomap::read_recording(*folder);
  turbomap::write_recording(copy.path(), r);
  const turbomap::recording again = turbomap::read_recording(copy.path());
  std::vector<std::string> before, after;
  const auto into = [](std::vector<std::string>& all) {
    return [&all](const char*, const auto& rows, turbomap::recording_rows, turbomap::presence) {
      all.emplace_back(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(*rows.data()));
    };
  };
  turbomap::visit_arrays(r, into(before));
  turbomap::visit_arrays(again, into(after));
  CHECK((before == after));
  CHECK(again.meta.camera1 == r.meta.camera1);
  CHECK(again.meta.T_bc.qx == r.meta.T_bc.qx);
  CHECK(again.meta.close_depth == r.meta.close_depth);
}
