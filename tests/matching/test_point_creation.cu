// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Point creation on a device: the oracle's answer, and that of the host to the last bit, positions included.

#include <thrust/system/cuda/execution_policy.h>

#include "matching_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::creation_options;
using turbomap::search_options;

template <class Camera>
void check_rig(const test_rig<Camera>& rig, unsigned seed, const creation_options& options, long least) {
  const stream on;
  tally t;
  std::vector<long> outcomes(11);
  search_options wide;
  wide.max_distance = 256, wide.line_chi2 = 60, wide.epipole_radius = 2, wide.reprojection_chi2 = 30;
  wide.max_parallax_cosine = 1;
  for (const motion how : {motion::sideways, motion::forward, motion::backward, motion::along_axis, motion::anything}) {
    scene_recipe recipe;
    recipe.seed = seed++, recipe.how = how, recipe.mapped = 0.1,
    recipe.query_keypoints = recipe.neighbour_keypoints = 250;
    recipe.prototypes = 40;
    scene<orb, Camera> s(rig, recipe);
    check_creation(on.policy(), s, {}, options, t, outcomes);
    check_creation(on.policy(), s, wide, options, t, outcomes);
  }
  check_tally(t, least);
}

TEST_CASE("points of pinhole and stereo keyframes") {
  check_rig(pinhole_rig(), 1, {}, 100);
  check_rig(pinhole_rig(50), 11, {}, 200);
}
TEST_CASE("points of fisheye and mixed rigs") {
  check_rig(fisheye_rig(), 21, {}, 100);
  check_rig(mixed_rig(), 41, {}, 50);
}
TEST_CASE("other options") {
  creation_options o;
  o.max_parallax_cosine = 0.9996, o.mono_chi2 = 2, o.stereo_chi2 = 20, o.scale_tolerance = 1, o.max_distance = 4;
  check_rig(pinhole_rig(50), 31, o, 20);
}

TEST_CASE("creation follows the search in the stream, nobody waits in between, and both are used again") {
  const stream on;
  turbomap::context<stream_policy> ctx(on.policy());
  turbomap::correspondences<orb, pinhole_camera, stream_policy> found(ctx);
  turbomap::point_creation<stream_policy> points(ctx);
  for (unsigned round = 0; round < 6; ++round) {
    scene_recipe recipe;
    recipe.seed = round, recipe.query_keypoints = round % 2 == 0 ? 200 : 50;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    const resident_scene<orb, pinhole_camera, stream_policy> keyframes(ctx, s);
    turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), {}, found);
    turbomap::create_points(ctx, found, {}, points);
    const auto got = points.plan(ctx, found);
    CHECK(!got.empty());
    CHECK(same(got, create_under(sequential{}, s, {}, {})));
  }
}

TEST_CASE("nothing found, nothing created") {
  const stream on;
  scene_recipe recipe;
  recipe.query_keypoints = 0;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  CHECK(create_under(on.policy(), s, {}, {}).empty());
}

}  // namespace
