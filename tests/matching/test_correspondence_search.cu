// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The correspondence search on a device: the oracle's answer, and that of the host to the last bit.

#include <turbomap/descriptor/real.hpp>

#include <thrust/system/cuda/execution_policy.h>

#include <array>
#include <atomic>
#include <memory>

#include "matching_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::search_options;

constexpr motion proper_motions[] = {motion::sideways, motion::forward, motion::backward, motion::along_axis};

template <class Descriptor = orb, class Camera>
void check_motions(const test_rig<Camera>& rig, unsigned seed, long least_matches, search_options options = {},
                   scene_recipe recipe = {}) {
  const stream on;
  tally t;
  for (const motion how : proper_motions) {
    recipe.seed = seed++;
    recipe.how = how;
    scene<Descriptor, Camera> s(rig, recipe);
    check_all_searches(on.policy(), s, options, t);
  }
  check_tally(t, least_matches);
}

TEST_CASE("pinhole keyframes") {
  check_motions(pinhole_rig(), 10, 1000);
  scene_recipe large;
  large.query_keypoints = 1200, large.neighbour_keypoints = 1100, large.neighbours = 10, large.prototypes = 60;
  check_motions(pinhole_rig(50), 20, 1000, {}, large);
}
TEST_CASE("fisheye pairs") { check_motions(fisheye_rig(), 30, 500); }
TEST_CASE("every camera model, and rigs of mixed ones") {
  check_motions(mixed_rig(), 40, 500);
  check_motions(double_sphere_rig(), 50, 500);
  check_motions(brown_conrady_rig(), 60, 500);
  check_motions(equisolid_rig(), 70, 500);
}
TEST_CASE("other descriptors and thresholds") {
  search_options options;
  options.max_distance = 75;
  check_motions<turbomap::binary_descriptor<384>>(pinhole_rig(50), 80, 1000, options);
  options.max_distance = 31;
  check_motions<turbomap::binary_descriptor<160>>(pinhole_rig(50), 85, 100, options);
  options.max_distance = 1;
  check_motions<turbomap::real_descriptor<float, 64>>(pinhole_rig(50), 90, 1000, options);
  options = {};
  options.max_distance = 256, options.line_chi2 = 100, options.reprojection_chi2 = 60, options.epipole_radius = 40;
  check_motions(pinhole_rig(), 100, 1000, options);
}

TEST_CASE("groups of one keypoint, and of all of them") {
  for (const int groups : {1, 2, 500}) {
    scene_recipe recipe;
    recipe.groups = groups, recipe.query_keypoints = 300, recipe.neighbour_keypoints = 280;
    check_motions(pinhole_rig(50), 350, 1000, {}, recipe);
  }
}

TEST_CASE("a flag that is set before keeps all but grouped searches from beginning") {
  const stream on;
  const scene<orb, pinhole_camera> s(pinhole_rig(), {});
  const std::atomic<bool> stop{true};
  for (const auto set : every_candidate_set) {
    search_options options;
    options.candidate_set = set;
    const auto expected = search_under(on.policy(), s, options);
    REQUIRE(!expected.empty());
    options.stop = &stop;
    const auto found = search_under(on.policy(), s, options);
    if (set == turbomap::candidates::grouped)
      CHECK(same(found, expected));
    else
      CHECK(found.empty());
  }
}

TEST_CASE("nothing to do, and very little") {
  const stream on;
  tally t;
  for (const auto [query, neighbours, keypoints] :
       {std::array<int, 3>{0, 3, 50}, std::array<int, 3>{50, 0, 50}, std::array<int, 3>{50, 3, 0},
        std::array<int, 3>{0, 0, 0}, std::array<int, 3>{1, 1, 1}, std::array<int, 3>{1, 5, 40},
        std::array<int, 3>{40, 2, 1}}) {
    scene_recipe recipe;
    recipe.query_keypoints = query, recipe.neighbours = neighbours, recipe.neighbour_keypoints = keypoints;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    check_all_searches(on.policy(), s, {}, t);
  }
  CHECK(t.differences == 0);
}

/// Degenerate poses are noise, but the same noise everywhere.
TEST_CASE("host and device agree to the last bit in any configuration") {
  const stream on;
  long matches = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.how = every_motion[seed % 7], recipe.at_epipole = 0.3;
    scene<orb, pinhole_camera> straight(pinhole_rig(seed % 2 == 0 ? 50 : 0), recipe);
    scene<orb, fisheye_camera> curved(fisheye_rig(1 + static_cast<int>(seed % 3)), recipe);
    for (const auto set : every_candidate_set) {
      search_options options;
      options.candidate_set = set;
      options.ties = every_tie_rule[seed / 2 % 2];
      options.max_distance = seed % 3 == 0 ? 256 : 50;
      const auto a = search_under(sequential{}, straight, options);
      const auto b = search_under(sequential{}, curved, options);
      for (const bool tensor_cores : {true, false}) {
        options.tensor_cores = tensor_cores;
        CHECK(same(a, search_under(on.policy(), straight, options)));
        CHECK(same(b, search_under(on.policy(), curved, options)));
      }
      matches += static_cast<long>(a.size() + b.size());
    }
  }
  CHECK(matches > 1000);
}

TEST_CASE("several contexts share one device, and a result is used again") {
  constexpr int count = 4;
  std::vector<std::unique_ptr<scene<orb, pinhole_camera>>> scenes;
  std::vector<plan_of<orb, pinhole_camera>> expected;
  for (unsigned seed = 0; seed < count; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.query_keypoints = 300, recipe.neighbours = 1 + static_cast<int>(seed);
    scenes.push_back(std::make_unique<scene<orb, pinhole_camera>>(pinhole_rig(50), recipe));
    expected.push_back(search_under(sequential{}, *scenes.back(), {}));
  }
  struct lane {
    stream on;
    turbomap::context<stream_policy> ctx{on.policy()};
    turbomap::correspondences<orb, pinhole_camera, stream_policy> result{ctx};
    std::vector<std::unique_ptr<resident_scene<orb, pinhole_camera, stream_policy>>> keyframes;
  };
  std::vector<std::unique_ptr<lane>> lanes;
  for (int l = 0; l < count; ++l) {
    lanes.push_back(std::make_unique<lane>());
    for (const auto& s : scenes)
      lanes.back()->keyframes.push_back(
          std::make_unique<resident_scene<orb, pinhole_camera, stream_policy>>(lanes.back()->ctx, *s));
  }
  for (int round = 0; round < 2 * count; ++round) {
    // All are enqueued before anything is waited for; one of them twice, over the work of its own first call.
    for (int l = 0; l < count; ++l)
      for (int again = 0; again < (l == 0 ? 2 : 1); ++again) {
        const auto& k = *lanes[static_cast<std::size_t>(l)]->keyframes[static_cast<std::size_t>((l + round) % count)];
        auto& w = *lanes[static_cast<std::size_t>(l)];
        turbomap::search_correspondences(w.ctx, k.query(), k.neighbours(), {}, w.result);
      }
    for (int l = 0; l < count; ++l) {
      auto& w = *lanes[static_cast<std::size_t>(l)];
      CHECK(same(w.result.plan(w.ctx), expected[static_cast<std::size_t>((l + round) % count)]));
    }
  }
}

TEST_CASE("bad input is refused before anything is launched") {
  const stream on;
  scene_recipe recipe;
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  turbomap::context<stream_policy> ctx(on.policy());
  const resident_scene<orb, pinhole_camera, stream_policy> keyframes(ctx, s);
  auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours());
  const auto before = found.plan(ctx);
  CHECK(!before.empty());
  auto query = keyframes.query();
  query.T_cw.qw = 7;
  CHECK_THROWS_AS(turbomap::search_correspondences(ctx, query, keyframes.neighbours(), {}, found),
                  std::invalid_argument);
  CHECK(same(found.plan(ctx), before));
}

}  // namespace
