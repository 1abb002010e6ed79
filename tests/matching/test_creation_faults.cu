// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The n-th launch, copy or wait of point creation fails once, for every n: no points are left, neither new nor old ones.

#include "support/failing_device.cuh"

#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/matching/point_creation.hpp>

#include "support/fail_everywhere.hpp"
#include "support/stream.cuh"
#include "track_creation_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::creation_options;

/// Searched keyframes on a device, and the tracks of their matches.
struct searched {
  stream on;
  scene<orb, pinhole_camera> s;
  turbomap::context<stream_policy> ctx;
  resident_scene<orb, pinhole_camera, stream_policy> keyframes;
  turbomap::correspondences<orb, pinhole_camera, stream_policy> found;
  turbomap::match_tracks<orb, pinhole_camera, stream_policy> tracks;

  searched()
      : s(pinhole_rig(50), scene_recipe{}),
        ctx(on.policy()),
        keyframes(ctx, s),
        found(turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), {})),
        tracks(ctx) {
    turbomap::join_tracks(ctx, found, tracks);
  }
  /// Lets everything fail once that create() does on the device. What it left is looked at by check(), and made anew.
  template <class Create, class Check>
  int fail(const Create& create, const Check& check) {
    create();
    return fail_everywhere<failure_of<work, false>, turbomap::device_error>(create, [&] { check(), create(); });
  }
};

TEST_CASE("points of matches") {
  searched in;
  turbomap::point_creation<stream_policy> made(in.ctx);
  REQUIRE(in.found.size() > 0);
  const int failures = in.fail([&] { turbomap::create_points(in.ctx, in.found, creation_options{}, made); },
                               [&] { CHECK_THROWS_AS(made.plan(in.ctx, in.found), std::invalid_argument); });
  CHECK(failures > 1);
}

TEST_CASE("points of tracks") {
  searched in;
  turbomap::track_creation<stream_policy> made(in.ctx);
  REQUIRE(in.tracks.tracks().size() > 0);
  const int failures =
      in.fail([&] { turbomap::create_track_points(in.ctx, in.found, in.tracks, creation_options{}, made); },
              [&] {
                std::vector<turbomap::created_track> points;
                std::vector<std::uint8_t> kept;
                made.plan(in.ctx, points, kept);
                CHECK(points.empty());
                CHECK(kept.empty());
              });
  CHECK(failures > 2);
}

}  // namespace
