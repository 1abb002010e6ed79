// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Matches that were found elsewhere are as good as those of a search; wrong ones are refused by name.

#include <turbomap/matching/filters.hpp>
#include <turbomap/matching/given_correspondences.hpp>

#include <thrust/execution_policy.h>

#include <stdexcept>
#include <string>

#include "matching_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::search_options;
using match = turbomap::correspondence<std::int32_t>;
using matches_view = turbomap::span<const match>;

template <class Policy, class Camera>
void check_round_trip(const test_rig<Camera>& rig, turbomap::candidates set) {
  scene_recipe recipe;
  recipe.seed = 3;
  scene<orb, Camera> s(rig, recipe);
  search_options options;
  options.candidate_set = set;
  turbomap::context<Policy> ctx{Policy{}};
  const resident_scene<orb, Camera, Policy> keyframes(ctx, s);
  turbomap::correspondences<orb, Camera, Policy> found(ctx), given(ctx);
  turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options, found);
  const auto plan = found.plan(ctx);
  REQUIRE(plan.size() > 20);
  auto shuffled = plan;  // in any order
  std::reverse(shuffled.begin(), shuffled.end());
  turbomap::given_correspondences(ctx, keyframes.query(), keyframes.neighbours(), matches_view(shuffled), options,
                                  given);
  CHECK(same(given.plan(ctx), plan));
  CHECK(given.queries() == found.queries());

  turbomap::point_creation<Policy> from_search(ctx), from_given(ctx);
  turbomap::create_points(ctx, found, {}, from_search);
  turbomap::create_points(ctx, given, {}, from_given);
  CHECK(same(from_given.plan(ctx, given), from_search.plan(ctx, found)));
  const turbomap::ratio_test ratio{0.9};
  turbomap::filter(ctx, found, ratio, turbomap::mutual_best{}, turbomap::rotation_histogram{}, turbomap::one_to_one{});
  turbomap::filter(ctx, given, ratio, turbomap::mutual_best{}, turbomap::rotation_histogram{}, turbomap::one_to_one{});
  const auto left = found.plan(ctx);
  CHECK(same(given.plan(ctx), left));
  CHECK(left.size() < plan.size());

  turbomap::given_correspondences(ctx, keyframes.query(), keyframes.neighbours(), matches_view(), options, given);
  CHECK(given.plan(ctx).empty());
}

TEST_CASE_TEMPLATE("the matches of a search, given back", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto set : every_candidate_set) {
    check_round_trip<Policy>(pinhole_rig(50), set);
    check_round_trip<Policy>(fisheye_rig(), set);
  }
}

TEST_CASE("what no search would have found") {
  scene_recipe recipe;
  recipe.mapped = 0;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  turbomap::context<sequential> ctx{sequential{}};
  const auto neighbours = s.neighbours();
  // Far apart in every sense; one neighbour keypoint twice; one query keypoint with two neighbours.
  const std::vector<match> given{{0, 7, 9, 1000}, {0, 8, 9, 0}, {2, 7, 0, 5}};
  turbomap::correspondences<orb, pinhole_camera, sequential> result(ctx);
  turbomap::given_correspondences(ctx, s.query(), turbomap::span<const decltype(s.query())>(neighbours),
                                  matches_view(given), {}, result);
  CHECK(same(result.plan(ctx), given));
}

TEST_CASE("wrong matches are refused by name, and the result stays") {
  scene_recipe recipe;
  recipe.query_keypoints = 40, recipe.neighbour_keypoints = 50, recipe.neighbours = 2, recipe.mapped = 0;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  s.frames[0].has_point[3] = 1;
  s.frames[2].has_point[4] = 255;
  turbomap::context<sequential> ctx{sequential{}};
  const auto neighbours = s.neighbours();
  const turbomap::span<const decltype(s.query())> others(neighbours);
  turbomap::correspondences<orb, pinhole_camera, sequential> result(ctx);
  const std::vector<match> good{{0, 1, 4, 3}, {1, 1, 3, 2}};
  turbomap::given_correspondences(ctx, s.query(), others, matches_view(good), {}, result);
  const auto message = [&](const std::vector<match>& bad, const search_options& options = {}) {
    try {
      turbomap::given_correspondences(ctx, s.query(), others, matches_view(bad), options, result);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::string start = "turbomap: matches[].";
  CHECK(message({good[0], {2, 0, 0, 1}}) == start + "neighbour = 2: is not the number of a neighbour");
  CHECK(message({{-1, 0, 0, 1}}) == start + "neighbour = -1: is not the number of a neighbour");
  CHECK(message({{0, 40, 0, 1}}) == start + "query = 40: is not a query keypoint");
  CHECK(message({{0, -1, 0, 1}}) == start + "query = -1: is not a query keypoint");
  CHECK(message({{0, 0, 50, 1}}) == start + "candidate = 50: is not a keypoint of the neighbour");
  CHECK(message({{0, 0, -1, 1}}) == start + "candidate = -1: is not a keypoint of the neighbour");
  CHECK(message({{0, 3, 0, 1}}) == start + "query = 3: holds a map point");
  CHECK(message({{1, 0, 4, 1}}) == start + "candidate = 4: holds a map point");
  CHECK(message({{0, 0, 0, -1}}) == start + "distance = -1: must not be negative");
  CHECK(message({{0, 5, 0, 1}, {1, 5, 0, 1}, {0, 5, 1, 1}}) == start + "query = 5: has two matches with one neighbour");
  search_options options;
  options.scales.levels = 0;
  CHECK(message(good, options).find("options.scales.levels") != std::string::npos);
  auto query = s.query();
  query.view.groups.group_count = 1 << 30;  // too many for a call, which is known after the matches were found good
  CHECK_THROWS_AS(turbomap::given_correspondences(ctx, query, others, matches_view(good), {}, result),
                  std::invalid_argument);
  CHECK(same(result.plan(ctx), good));
}

TEST_CASE("a match of a query keypoint with itself is refused by name, and the result stays") {
  scene_recipe recipe;
  recipe.neighbours = 1, recipe.mapped = 0;
  scene<orb, fisheye_camera> s(fisheye_rig(), recipe);
  turbomap::context<sequential> ctx{sequential{}};
  const auto neighbours = s.neighbours();
  search_options options;
  options.across_rig = true;  // neighbour 1 is the query
  turbomap::correspondences<orb, fisheye_camera, sequential> result(ctx);
  const auto give = [&](const std::vector<match>& given) {
    turbomap::given_correspondences(ctx, s.query(), turbomap::span<const decltype(s.query())>(neighbours),
                                    matches_view(given), options, result);
  };
  const std::vector<match> good{{0, 5, 5, 3}, {1, 5, 6, 2}};  // keypoint 5 of another keyframe is another
  give(good);
  CHECK_THROWS_WITH_AS(give({good[0], {1, 7, 7, 2}}), "turbomap: matches[].candidate = 7: is the query keypoint itself",
                       std::invalid_argument);
  CHECK(same(result.plan(ctx), good));
}

}  // namespace
