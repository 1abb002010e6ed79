// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The filters of correspondences against their oracle, under every host policy, and their edge cases.

#include <thrust/execution_policy.h>

#include <memory_resource>
#include <new>

#include "filter_windows_cases.hpp"
#include "filters_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::search_options;

TEST_CASE_TEMPLATE("pinhole matches are filtered as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_all_filters<Policy>(pinhole_rig(50), crowded(10), permissive(), 5);
}
TEST_CASE_TEMPLATE("fisheye matches are filtered as the oracle says", Policy, TURBOMAP_TEST_POLICIES) {
  check_all_filters<Policy>(fisheye_rig(), crowded(20), permissive(), 5);
}
TEST_CASE_TEMPLATE("filters that ask windows only decide as if they had asked all", Policy,
                   TURBOMAP_TEST_TWO_POLICIES) {
  check_filter_windows<Policy>(pinhole_rig(), 50);
  check_filter_windows<Policy>(fisheye_rig(), 70);
}
TEST_CASE("given matches of keypoints in different groups") { check_given_matches_of_other_groups<sequential>(); }
TEST_CASE("distances of floats") {
  auto options = permissive();
  options.max_distance = 1.5;
  check_all_filters<sequential, turbomap::real_descriptor<float, 64>>(pinhole_rig(), crowded(30), options, 5);
}

TEST_CASE_TEMPLATE("rotations: equal ones, the wrap at a full turn", Policy, TURBOMAP_TEST_POLICIES) {
  check_rotation_edges<Policy>();
}
TEST_CASE_TEMPLATE("claims: none, one, equal distances", Policy, TURBOMAP_TEST_POLICIES) {
  check_one_to_one_edges<Policy>();
}
TEST_CASE_TEMPLATE("nothing to filter", Policy, TURBOMAP_TEST_POLICIES) { check_empty_filters<Policy>(); }
TEST_CASE_TEMPLATE("options out of range, angles missing", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  check_filter_options<Policy>();
}
TEST_CASE_TEMPLATE("no allocation in the steady state", Policy, TURBOMAP_TEST_POLICIES) {
  check_filter_allocations<Policy>(std::pmr::get_default_resource());
}

TEST_CASE("a ratio is of distances, though those of real descriptors come squared") {
  using real = turbomap::real_descriptor<float, 2>;
  turbomap::keyframe_packing_scratch scratch;
  scene_frame<real, pinhole_camera> query, neighbour;
  const auto make = [&](auto& frame, std::vector<float> columns, std::vector<float> descriptors) {
    frame.cameras = {{pinhole_camera{400, 400, 320, 240}, {}, 0, {}}}, frame.bounds = {0, 0, 640, 480};
    for (const float x : columns) {
      turbomap::keypoint k;
      k.x = x, k.y = 240;
      frame.keypoints.push_back(k);
    }
    frame.descriptors = descriptors;
    frame.pack(scratch, {1.2F, 8});
  };
  neighbour.T_cw.tx = -0.3;
  make(query, {320}, {0, 0}), make(neighbour, {300, 280}, {0.85F, 0, 1, 0});
  using posed = turbomap::posed_keyframe<real, pinhole_camera>;
  const std::vector<posed> neighbours{neighbour.posed()};
  turbomap::search_options options;
  options.max_distance = 2;
  for (const double ratio : {0.84, 0.86}) {
    turbomap::context<sequential> ctx;
    turbomap::correspondences<real, pinhole_camera, sequential> result(ctx);
    turbomap::search_correspondences(ctx, query.posed(), turbomap::span<const posed>(neighbours), options, result);
    REQUIRE(result.plan(ctx).size() == 1);
    turbomap::filter(ctx, result, ratio_test{ratio});
    CHECK(result.plan(ctx).size() == (ratio < 0.85 ? 0 : 1));
  }
}

TEST_CASE("a claim of distance -0 is one of distance 0, whoever gave it") {
  using real = turbomap::real_descriptor<float, 64>;
  scene_recipe recipe;
  recipe.neighbours = 1, recipe.mapped = -1;
  scene<real, pinhole_camera> s(pinhole_rig(), recipe);
  turbomap::context<sequential> ctx{sequential{}};
  const auto neighbours = s.neighbours();
  const std::vector<turbomap::correspondence<float>> given{{0, 3, 5, 0.5F}, {0, 4, 5, -0.0F}, {0, 6, 5, 0.0F}};
  turbomap::correspondences<real, pinhole_camera, sequential> result(ctx);
  turbomap::given_correspondences(ctx, s.query(), turbomap::span<const decltype(s.query())>(neighbours),
                                  turbomap::span<const turbomap::correspondence<float>>(given), {}, result);
  turbomap::filter(ctx, result, one_to_one{});
  const auto left = result.plan(ctx);
  REQUIRE(left.size() == 1);
  CHECK(left[0].query == 4);
}

TEST_CASE("given matches of keypoints without a group pass the tests of a grouped search") {
  scene_recipe recipe;
  recipe.neighbours = 1, recipe.mapped = -1;
  scene<orb, pinhole_camera> s(pinhole_rig(), recipe);
  for (auto& f : s.frames) {
    for (std::size_t i = 0; i < f.keypoints.size(); i += 2) f.keypoints[i].group = turbomap::keypoint::no_group;
    s.repack(f);
  }
  turbomap::context<sequential> ctx{sequential{}};
  const auto neighbours = s.neighbours();
  const plan_of<orb, pinhole_camera> given{{0, 0, 0, 200}, {0, 1, 2, 200}, {0, 2, 1, 200}, {0, 4, 4, 256}};
  search_options options;
  options.candidate_set = turbomap::candidates::grouped;
  turbomap::correspondences<orb, pinhole_camera, sequential> result(ctx);
  turbomap::given_correspondences(ctx, s.query(), turbomap::span<const decltype(s.query())>(neighbours),
                                  turbomap::span<const turbomap::correspondence<int>>(given), options, result);
  turbomap::filter(ctx, result, mutual_best{}, ratio_test{0.5});
  const auto left = result.plan(ctx);
  for (const int ungrouped : {0, 4})
    CHECK(std::any_of(left.begin(), left.end(), [&](const auto& m) { return m.query == ungrouped; }));
}

TEST_CASE("a result whose search found no memory has nothing to filter, and the keyframes before it are not read") {
  scene_recipe few, many;
  few.query_keypoints = few.neighbour_keypoints = 20, few.neighbours = 1;
  many.neighbours = 40;
  scene<orb, pinhole_camera> second(pinhole_rig(), many);
  const auto neighbours = second.neighbours();
  search_options options;
  options.candidate_set = turbomap::candidates::grouped;
  long failures = 0;
  for (bool done = false; !done; ++failures) {  // each allocation of the second search fails once
    counting_resource resource(std::pmr::new_delete_resource());
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    turbomap::correspondences<orb, pinhole_camera, sequential> result(ctx);
    {
      scene<orb, pinhole_camera> first(pinhole_rig(), few);
      const auto found_in = first.neighbours();
      turbomap::search_correspondences(ctx, first.query(), turbomap::span<const decltype(first.query())>(found_in),
                                       options, result);
      REQUIRE(result.size() > 0);
    }
    resource.refuse_from = resource.allocations + failures, resource.refusals = 1;
    try {
      turbomap::search_correspondences(ctx, second.query(), turbomap::span<const decltype(second.query())>(neighbours),
                                       options, result);
      done = true;
    } catch (const std::bad_alloc&) {
      resource.refuse_from = -1;
      REQUIRE(result.keypoint_counts().empty());
      REQUIRE(result.queries().empty());
      const long before = resource.allocations;
      turbomap::filter(ctx, result, ratio_test{}, mutual_best{}, one_to_one{});
      CHECK(resource.allocations == before);
      CHECK(result.plan(ctx).empty());
    }
  }
  CHECK(failures > 3);
}

}  // namespace
