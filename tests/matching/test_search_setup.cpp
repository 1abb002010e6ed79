// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Bad input of the correspondence search, the memory it asks for, and several contexts at once.

#include <turbomap/matching/track_creation.hpp>

#include <thrust/execution_policy.h>

#include <atomic>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "matching_cases.hpp"
#include "scenes/keyframe_samples.hpp"
#include "support/counted_new.hpp"
#include "support/fail_everywhere.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::search_options;
using posed = turbomap::posed_keyframe<orb, pinhole_camera>;
using posed_span = turbomap::span<const posed>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

scene<orb, pinhole_camera> make_scene(unsigned seed = 1) {
  scene_recipe recipe;
  recipe.seed = seed;
  return {pinhole_rig(50), recipe};
}

/// A search and the plan it left; refused calls must leave it like that.
struct bad_input {
  scene<orb, pinhole_camera> s = make_scene();
  turbomap::context<sequential> ctx{};
  turbomap::correspondences<orb, pinhole_camera, sequential> result{ctx};
  posed query = s.query();
  std::vector<posed> neighbours = s.neighbours();
  search_options options;

  bad_input() { turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, result); }

  /// `spoil` changes a copy; the message must hold `text`.
  void refused(const char* text, const std::function<void(bad_input&)>& spoil) {
    CAPTURE(text);
    const auto before = result.plan(ctx);
    REQUIRE(!before.empty());
    const posed good_query = query;
    const auto good_neighbours = neighbours;
    spoil(*this);
    std::string message;
    try {
      turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, result);
    } catch (const std::invalid_argument& e) {
      message = e.what();
    }
    CAPTURE(message);
    CHECK(message.find(text) != std::string::npos);
    CHECK(same(result.plan(ctx), before));
    query = good_query, neighbours = good_neighbours, options = {};
    turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, result);
    CHECK(same(result.plan(ctx), before));
  }
};

TEST_CASE("bad keyframes are refused by name, and the last result stays") {
  bad_input in;
  in.refused("query.T_cw = nan", [](auto& b) { b.query.T_cw.tx = nan; });
  in.refused("query.T_cw = inf", [](auto& b) { b.query.T_cw.tz = infinity; });
  in.refused("neighbours[2].T_cw = nan", [](auto& b) { b.neighbours[2].T_cw.qw = nan; });
  in.refused("neighbours[1].T_cw squared quaternion norm = ", [](auto& b) { b.neighbours[1].T_cw.qw += 0.5; });
  in.refused("query.T_cw squared quaternion norm = 0",
             [](auto& b) { b.query.T_cw.qx = b.query.T_cw.qy = b.query.T_cw.qz = b.query.T_cw.qw = 0; });
  in.refused("query.has_point.size() = 149", [](auto& b) { b.query.has_point = b.query.has_point.subspan(0, 149); });
  in.refused("neighbours[0].has_point.size() = 1",
             [](auto& b) { b.neighbours[0].has_point = b.neighbours[0].has_point.subspan(0, 1); });
  in.refused("query.view", [](auto& b) { b.query.view.pixel = nullptr; });
  in.refused("query.view", [](auto& b) { b.query.view.descriptor = nullptr; });
  in.refused("neighbours[1].view", [](auto& b) { b.neighbours[1].view.octave = nullptr; });
  in.refused("neighbours[1].view", [](auto& b) { b.neighbours[1].view.bearing = nullptr; });
  in.refused("neighbours[0].view.keypoint_count = -1", [](auto& b) { b.neighbours[0].view.keypoint_count = -1; });
  in.refused("query.view.camera_count = 0", [](auto& b) { b.query.view.camera_count = 0; });
  in.refused("query.view.camera_count = 1", [](auto& b) { b.query.view.cameras = nullptr; });
}

TEST_CASE("bad options are refused by name, and the last result stays") {
  bad_input in;
  const auto option = [&in](const char* name, auto member, std::initializer_list<double> values) {
    for (const double v : values)
      in.refused((std::string("options.") + name + " = ").c_str(), [&](auto& b) { member(b.options) = v; });
  };
  option("max_distance", [](auto& o) -> double& { return o.max_distance; }, {-1, nan, infinity, 1e10});
  option("line_chi2", [](auto& o) -> double& { return o.line_chi2; }, {-3.84, 0, nan, infinity});
  option("reprojection_chi2", [](auto& o) -> double& { return o.reprojection_chi2; }, {-1, 0, nan, infinity});
  option("epipole_radius", [](auto& o) -> double& { return o.epipole_radius; }, {-1, nan});
  option("max_parallax_cosine", [](auto& o) -> double& { return o.max_parallax_cosine; }, {1.01, nan});
  for (const float v : {-1.0F, 0.5F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
    in.refused("options.scales.scale_factor = ", [&](auto& b) { b.options.scales.scale_factor = v; });
  for (const int v : {-1, 0, 257})
    in.refused("options.scales.levels = ", [&](auto& b) { b.options.scales.levels = v; });
}

/// Allocations of one search, its plan, creation and its plan, after some rounds of warming up.
template <class Policy>
void check_steady_state(bool count_everything) {
  auto s = make_scene();
  const posed query = s.query();
  const auto neighbours = s.neighbours();
  counting_resource resource(std::pmr::new_delete_resource());
  {
    turbomap::context<Policy> ctx(Policy{}, &resource, &resource);
    turbomap::correspondences<orb, pinhole_camera, Policy> found(ctx);
    turbomap::point_creation<Policy> points(ctx);
    typename turbomap::correspondences<orb, pinhole_camera, Policy>::plan_type plan;
    std::vector<turbomap::created_point> created;
    long before = 0, before_resource = 0;
    for (int round = 0; round < 8; ++round) {
      if (round == 4) before = allocations, before_resource = resource.allocations;
      for (const auto set : every_candidate_set) {
        search_options options;
        options.candidate_set = set;
        turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, found);
        found.plan(ctx, plan);
        turbomap::create_points(ctx, found, {}, points);
        points.plan(ctx, found, created);
      }
    }
    CHECK(resource.allocations == before_resource);
    if (count_everything) CHECK(allocations == before);
    CHECK(resource.allocations > 0);  // the user's memory was used
    CHECK(!plan.empty());
  }
  CHECK(resource.bytes_out == 0);
  CHECK(resource.mismatched == 0);
}

TEST_CASE("in the steady state nothing is allocated") {
  check_steady_state<sequential>(true);
  turbomap_test::for_each_parallel_policy([](auto policy) { check_steady_state<decltype(policy)>(false); });
}

TEST_CASE("all device-side memory comes from the user's resource") {
  auto s = make_scene();
  const posed query = s.query();
  const auto neighbours = s.neighbours();
  counting_resource resource(std::pmr::new_delete_resource());
  counting_resource other(std::pmr::new_delete_resource());
  auto* const previous = std::pmr::set_default_resource(&other);
  {
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    const auto found = turbomap::search_correspondences(ctx, query, posed_span(neighbours));
    turbomap::point_creation<sequential> points(ctx);
    turbomap::create_points(ctx, found, {}, points);
    CHECK(!points.plan(ctx, found).empty());
  }
  std::pmr::set_default_resource(previous);
  CHECK(other.allocations == 0);
  CHECK(resource.allocations > 0);
}

TEST_CASE("wherever memory runs out, the next call works and nothing is lost") {
  auto s = make_scene();
  const posed query = s.query();
  const auto neighbours = s.neighbours();
  for (const auto set : every_candidate_set) {
    search_options options;
    options.candidate_set = set;
    const auto expected = search_under(sequential{}, s, options);
    bool refused = true;
    long from = 0;
    for (; refused; ++from) {
      counting_resource resource(std::pmr::new_delete_resource());
      {
        turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
        turbomap::correspondences<orb, pinhole_camera, sequential> found(ctx);
        // A small search first, so that the refused call has something to grow.
        turbomap::search_correspondences(ctx, query, posed_span(neighbours.data(), 1), options, found);
        resource.refuse_from = resource.allocations + from, resource.refusals = 1;
        refused = false;
        try {
          turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, found);
        } catch (const std::bad_alloc&) {
          refused = true;
          const auto left = found.plan(ctx);  // all of the last one, or nothing
          CHECK((left.empty() || left.back().neighbour == 0));
        }
        turbomap::search_correspondences(ctx, query, posed_span(neighbours), options, found);
        CHECK(same(found.plan(ctx), expected));
      }
      CHECK(resource.bytes_out == 0);
      CHECK(resource.mismatched == 0);
      REQUIRE(from < 100);
    }
    CHECK(from > 3);
  }
}

TEST_CASE("contexts on several threads share the keyframes and nothing else") {
  std::vector<scene<orb, pinhole_camera>> scenes;
  for (unsigned seed = 0; seed < 3; ++seed) scenes.push_back(make_scene(seed));
  std::vector<plan_of<orb, pinhole_camera>> expected;
  for (auto& s : scenes) expected.push_back(search_under(sequential{}, s, {}));
  std::atomic<int> wrong{0};
  const auto work = [&](unsigned t) {
    turbomap::context<sequential> ctx{};
    turbomap::correspondences<orb, pinhole_camera, sequential> found(ctx);
    turbomap::point_creation<sequential> points(ctx);
    for (unsigned round = 0; round < 12; ++round) {
      const std::size_t i = (round + t) % scenes.size();
      const auto neighbours = scenes[i].neighbours();
      search_options options;
      options.candidate_set =
          round % 2 == 0 ? turbomap::candidates::exhaustive : turbomap::candidates::epipolar_ordered;
      turbomap::search_correspondences(ctx, scenes[i].query(), posed_span(neighbours), options, found);
      turbomap::create_points(ctx, found, {}, points);
      if (!same(found.plan(ctx), expected[i]) || points.plan(ctx, found).empty()) ++wrong;
    }
  };
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) threads.emplace_back(work, t);
  for (auto& t : threads) t.join();
  CHECK(wrong == 0);
}

TEST_CASE("tracks that found no memory, at whichever allocation, are of no search") {
  scene_recipe recipe;
  recipe.neighbours = 1, recipe.query_keypoints = recipe.neighbour_keypoints = 30;
  scene<orb, pinhole_camera> few(pinhole_rig(50), recipe), many = make_scene();
  turbomap::context<sequential> ctx;
  const auto search = [&](auto& s) {
    const auto neighbours = s.neighbours();
    return turbomap::search_correspondences(ctx, s.query(), posed_span(neighbours));
  };
  const auto before = search(few), found = search(many);
  turbomap::track_creation<sequential> made(ctx);
  std::optional<turbomap::match_tracks<orb, pinhole_camera, sequential>> tracks;
  const auto join_before = [&] {
    tracks.emplace(ctx);
    turbomap::join_tracks(ctx, before, *tracks);
    REQUIRE(tracks->are_of(before));
  };
  join_before();
  const int failures = fail_everywhere<no_memory_once>(
      [&] { turbomap::join_tracks(ctx, found, *tracks); },
      [&] {
        CHECK_FALSE(tracks->are_of(before));
        CHECK_FALSE(tracks->are_of(found));
        CHECK_THROWS_WITH_AS(turbomap::create_track_points(ctx, found, *tracks, {}, made), doctest::Contains("tracks"),
                             std::invalid_argument);
        join_before();
      });
  CHECK(tracks->are_of(found));
  CHECK(failures > 3);
}

}  // namespace
