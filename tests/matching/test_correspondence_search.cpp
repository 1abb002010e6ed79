// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The correspondence search against its oracle, under every host policy.

#include <turbomap/descriptor/real.hpp>

#include <thrust/execution_policy.h>

#include <array>

#include "matching_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::search_options;

/// Motions whose geometry is more than rounding.
constexpr motion proper_motions[] = {motion::sideways, motion::forward, motion::backward, motion::along_axis};

template <class Policy, class Descriptor = orb, class Camera>
void check_motions(const test_rig<Camera>& rig, unsigned seed, long least_matches, search_options options = {},
                   scene_recipe recipe = {}) {
  tally t;
  for (const motion how : proper_motions) {
    recipe.seed = seed++;
    recipe.how = how;
    scene<Descriptor, Camera> s(rig, recipe);
    check_all_searches(Policy{}, s, options, t);
  }
  check_tally(t, least_matches);
}

TEST_CASE_TEMPLATE("pinhole keyframes match as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_motions<Policy>(pinhole_rig(), 10, 1000);
  check_motions<Policy>(pinhole_rig(50), 20, 1000);
}
TEST_CASE_TEMPLATE("fisheye pairs match as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_motions<Policy>(fisheye_rig(), 30, 500);
}
TEST_CASE("every camera model, and rigs of mixed ones") {
  check_motions<sequential>(mixed_rig(), 40, 500);
  check_motions<sequential>(double_sphere_rig(), 50, 500);
  check_motions<sequential>(brown_conrady_rig(), 60, 500);
  check_motions<sequential>(equisolid_rig(), 70, 500);
}
TEST_CASE("other descriptors") {
  search_options options;
  options.max_distance = 75;
  check_motions<sequential, turbomap::binary_descriptor<384>>(pinhole_rig(50), 80, 1000, options);
  options.max_distance = 1;
  check_motions<sequential, turbomap::real_descriptor<float, 64>>(pinhole_rig(50), 90, 1000, options);
}
TEST_CASE("other thresholds") {
  search_options options;
  options.max_distance = 256, options.line_chi2 = 100, options.reprojection_chi2 = 60, options.epipole_radius = 40;
  check_motions<sequential>(pinhole_rig(), 100, 1000, options);
  check_motions<sequential>(fisheye_rig(), 110, 1000, options);
  options.max_distance = 0, options.epipole_radius = 0, options.max_parallax_cosine = 0.9;
  scene_recipe exact;
  exact.noise = 0, exact.mapped = 0;
  check_motions<sequential>(pinhole_rig(), 120, 1000, options, exact);
  check_motions<sequential>(fisheye_rig(), 130, 50, options, exact);
}

TEST_CASE_TEMPLATE("the cameras of a rig match with each other where that is asked for", Policy,
                   TURBOMAP_TEST_POLICIES) {
  search_options options;
  options.across_rig = true;
  check_motions<Policy>(fisheye_rig(), 130, 500, options);
  check_motions<Policy>(fisheye_rig(3), 140, 300, options);
  check_motions<Policy>(mixed_rig(), 150, 300, options);
  scene_recipe recipe;  // the search without is the same but for the last neighbour, which a single camera has not
  scene<orb, fisheye_camera> rig(fisheye_rig(), recipe);
  auto with = search_under(Policy{}, rig, options);
  const auto own = std::find_if(with.begin(), with.end(), [&](auto& m) { return m.neighbour == recipe.neighbours; });
  CHECK(own != with.end());
  with.erase(own, with.end());
  CHECK(same(with, search_under(Policy{}, rig, {})));
  scene<orb, pinhole_camera> single(pinhole_rig(), recipe);
  CHECK(same(search_under(Policy{}, single, options), search_under(Policy{}, single, {})));
}

TEST_CASE("any relative pose") {
  tally t;
  for (unsigned seed = 0; seed < 15; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.how = motion::anything;
    recipe.query_keypoints = recipe.neighbour_keypoints = 80;
    scene<orb, pinhole_camera> straight(pinhole_rig(50), recipe);
    check_all_searches(sequential{}, straight, {}, t);
    scene<orb, fisheye_camera> curved(fisheye_rig(), recipe);
    check_all_searches(sequential{}, curved, {}, t);
  }
  check_tally(t, 1000);
}

TEST_CASE_TEMPLATE("a bare policy works too", Policy, TURBOMAP_TEST_POLICIES) {
  scene_recipe recipe;
  recipe.seed = 190;
  scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
  const auto neighbours = s.neighbours();
  const turbomap::span<const turbomap::posed_keyframe<orb, pinhole_camera>> all(neighbours);
  const auto plan = turbomap::search_correspondences(Policy{}, s.query(), all);
  CHECK(!plan.empty());
  CHECK(same(plan, search_under(sequential{}, s, {})));
}

TEST_CASE("no baseline, no match between straight images") {
  scene_recipe recipe;
  recipe.how = motion::turn_at_origin;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  for (const auto set : every_candidate_set) {
    search_options options;
    options.candidate_set = set;
    CHECK(search_under(sequential{}, s, options).empty());
  }
}

TEST_CASE("masks: all mapped, none, no mask at all") {
  tally t;
  for (const double share : {-1.0, 0.0, 0.5, 1.0}) {
    scene_recipe recipe;
    recipe.seed = 200, recipe.mapped = share;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    const long before = t.matches;
    check_all_searches(sequential{}, s, {}, t);
    CHECK((t.matches == before) == (share == 1.0));
    // An empty mask of the query with masks of the neighbours, and the other way round.
    s.frames[0].has_point.clear();
    check_all_searches(sequential{}, s, {}, t);
    for (auto& f : s.frames) f.has_point.assign(f.has_point.size(), 0);
    check_all_searches(sequential{}, s, {}, t);
  }
  check_tally(t, 1000);
}

TEST_CASE_TEMPLATE("nothing to do", Policy, TURBOMAP_TEST_POLICIES) {
  tally t;
  for (const auto [query, neighbours, keypoints] :
       {std::array{0, 3, 50}, std::array{50, 0, 50}, std::array{50, 3, 0}, std::array{0, 0, 0}, std::array{1, 1, 1},
        std::array{1, 5, 40}, std::array{40, 2, 1}}) {
    scene_recipe recipe;
    recipe.query_keypoints = query, recipe.neighbours = neighbours, recipe.neighbour_keypoints = keypoints;
    recipe.mapped = 0;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    check_all_searches(Policy{}, s, {}, t);
    scene<orb, fisheye_camera> curved(fisheye_rig(), recipe);
    check_all_searches(Policy{}, curved, {}, t);
  }
  CHECK(t.differences == 0);
}

TEST_CASE("groups are missing in the query, in a neighbour, everywhere") {
  tally t;
  for (const int without : {0, 1, 2}) {
    scene_recipe recipe;
    recipe.seed = 300;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    for (std::size_t f = 0; f < s.frames.size(); ++f)
      if (without == 2 || static_cast<int>(f) == without) {
        for (auto& k : s.frames[f].keypoints) k.group = turbomap::keypoint::no_group;
        s.repack(s.frames[f]);
      }
    search_options options;
    options.candidate_set = turbomap::candidates::grouped;
    const long before = t.matches;
    check_search(sequential{}, s, options, t);
    CHECK((t.matches > before) == (without == 1));
  }
  CHECK(t.differences == 0);
}

TEST_CASE("groups of one keypoint, and of all of them") {
  tally t;
  for (const int groups : {1, 2, 500}) {
    scene_recipe recipe;
    recipe.seed = 350, recipe.groups = groups, recipe.query_keypoints = 300, recipe.neighbour_keypoints = 280;
    scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
    check_all_searches(sequential{}, s, {}, t);
    scene<orb, fisheye_camera> curved(fisheye_rig(), recipe);
    check_all_searches(turbomap_test::parallel{}, curved, {}, t);
  }
  check_tally(t, 1000);
}

TEST_CASE("rigs with different numbers of cameras") {
  tally t;
  for (int query_cameras = 1; query_cameras <= 3; ++query_cameras) {
    scene_recipe recipe;
    recipe.seed = 400 + static_cast<unsigned>(query_cameras), recipe.mapped = 0.1, recipe.landmarks = 0.9;
    scene<orb, fisheye_camera> s(fisheye_rig(3), recipe);
    // Each frame forgets the cameras beyond its own number, and what they saw.
    for (std::size_t f = 0; f < s.frames.size(); ++f) {
      auto& frame = s.frames[f];
      frame.cameras.resize((static_cast<std::size_t>(query_cameras) - 1 + f) % 3 + 1);
      for (auto& k : frame.keypoints) k.camera = static_cast<std::uint8_t>(k.camera % frame.cameras.size());
      s.repack(frame);
    }
    check_all_searches(sequential{}, s, {}, t);
  }
  check_tally(t, 300);
}

TEST_CASE("a grouped match is an exhaustive match, or a nearer one is") {
  std::size_t seen = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    scene_recipe recipe;
    recipe.seed = seed, recipe.mapped = 0.1;
    scene<orb, fisheye_camera> s(fisheye_rig(), recipe);
    search_options options;
    options.candidate_set = turbomap::candidates::grouped;
    const auto grouped = search_under(sequential{}, s, options);
    options.candidate_set = turbomap::candidates::exhaustive;
    const auto all = search_under(sequential{}, s, options);
    std::size_t i = 0;
    for (const auto& g : grouped) {
      while (i < all.size() &&
             (all[i].neighbour < g.neighbour || (all[i].neighbour == g.neighbour && all[i].query < g.query)))
        ++i;
      REQUIRE(i < all.size());
      CHECK((all[i].neighbour == g.neighbour && all[i].query == g.query && all[i].distance <= g.distance));
      ++seen;
    }
    CHECK(grouped.size() < all.size());
  }
  CHECK(seen > 100);
}

TEST_CASE_TEMPLATE("a result is used again and again", Policy, TURBOMAP_TEST_POLICIES) {
  turbomap::context<Policy> ctx{Policy{}};
  turbomap::correspondences<orb, pinhole_camera, Policy> result(ctx);
  for (int round = 0; round < 3; ++round)
    for (const int size : {10, 150, 0, 60}) {
      scene_recipe recipe;
      recipe.seed = static_cast<unsigned>(size);
      recipe.query_keypoints = size, recipe.neighbours = 1 + size % 3;
      scene<orb, pinhole_camera> s(pinhole_rig(50), recipe);
      const auto neighbours = s.neighbours();
      for (const auto set : every_candidate_set) {
        search_options options;
        options.candidate_set = set;
        turbomap::search_correspondences(ctx, s.query(), turbomap::span<const decltype(s.query())>(neighbours), options,
                                         result);
        CHECK(same(result.plan(ctx), search_under(sequential{}, s, options)));
        CHECK(same(result.plan(ctx), result.plan(ctx)));
      }
    }
}

}  // namespace
