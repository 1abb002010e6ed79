// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Points from tracks on a device: the oracle's answer, and that of the host to the last bit.

#include <thrust/system/cuda/execution_policy.h>

#include "support/stream.cuh"
#include "track_creation_cases.hpp"

namespace {

using namespace turbomap_test;

template <class Camera>
void check_rig(const test_rig<Camera>& rig, unsigned seed, long least) {
  const stream on;
  track_point_tally t;
  for (const motion how : {motion::sideways, motion::forward, motion::anything}) {
    scene_recipe recipe;
    recipe.seed = seed++, recipe.how = how, recipe.mapped = 0.1, recipe.neighbours = 6;
    recipe.query_keypoints = recipe.neighbour_keypoints = 200;
    recipe.prototypes = 60, recipe.landmarks = 0.9;
    scene<orb, Camera> s(rig, recipe);
    check_track_creation(on.policy(), s, {}, {}, t);
    turbomap::creation_options two;
    two.fewest_keyframes = 2;
    check_track_creation(on.policy(), s, {}, two, t);
  }
  check_track_points(t, least);
}

TEST_CASE("points of tracks of pinhole and stereo keyframes") {
  check_rig(pinhole_rig(), 1, 20);
  check_rig(pinhole_rig(50), 11, 50);
}
TEST_CASE("points of tracks of fisheye rigs") { check_rig(fisheye_rig(3), 21, 20); }

TEST_CASE("points of a rig whose keypoints look alike") {
  const stream on;
  const auto t = check_lookalikes(on.policy(), fisheye_rig(), 0.8);
  CHECK(t.outcomes[static_cast<std::size_t>(turbomap::creation_outcome::lookalike)] > 50);
}

TEST_CASE("nothing found, nothing created") {
  const stream on;
  scene_recipe recipe;
  recipe.query_keypoints = 0;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  CHECK(create_tracks_under(on.policy(), s, {}, {}).points.empty());
}

}  // namespace
