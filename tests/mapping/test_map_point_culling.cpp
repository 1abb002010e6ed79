// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Points on probation: what is dropped, when, and what leaves the list. Random maps are in test_map_properties.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/mapping/named_points.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <vector>

#include "reference/culling_oracle.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("points that few keyframes see go after two keyframes", Map, flat_map, pointer_map) {
  Map map;
  using traits = turbomap::map_traits<Map>;
  using point = typename traits::point;
  const std::vector<turbomap::keypoint> mono(9, make_keypoint(0)), stereo(9, make_keypoint(0, 0, 5.F));
  std::vector<typename traits::keyframe> k;
  for (int i = 0; i < 4; ++i) k.push_back(insert_keyframe(map, i == 0 ? stereo : mono, i, typename traits::keyframe{}));
  std::vector<point> p;
  for (std::size_t i = 0; i < 5; ++i) p.push_back(traits::add_point(map, {}, k[0]));
  const auto see = [&](std::size_t point, std::initializer_list<std::size_t> keyframes) {
    for (const std::size_t i : keyframes) CHECK(turbomap::observe(map, p[point], k[i], point));
  };
  see(0, {1, 2, 3});     // three measurements: dropped
  see(1, {0, 1, 2});     // four: stays
  see(2, {0, 1});        // three
  see(3, {0, 1, 2, 3});  // five
  std::vector<turbomap::recent_point<point>> recent;
  for (std::size_t i = 0; i < 5; ++i) recent.push_back({p[i], static_cast<std::int64_t>(i == 2 ? 11 : 10)});
  auto summary = turbomap::cull_recent_points(map, recent, 11);
  CHECK(summary.dropped == 0);
  CHECK(summary.released == 0);
  CHECK(recent.size() == 5);
  summary = turbomap::cull_recent_points(map, recent, 12);
  CHECK(summary.dropped == 2);  // 0, and 4 that nobody sees
  CHECK_FALSE(traits::alive(map, p[0]));
  CHECK_FALSE(traits::alive(map, p[4]));
  CHECK(traits::alive(map, p[2]));  // one keyframe younger
  REQUIRE(recent.size() == 3);
  CHECK(recent[1].point == p[2]);
  recent.push_back({p[0], 12});  // dead already
  recent.push_back({p[1], 12});  // named twice
  summary = turbomap::cull_recent_points(map, recent, 13);
  CHECK(summary.dropped == 1);
  CHECK(summary.released == 2);
  CHECK(recent.size() == 1);
  CHECK_FALSE(traits::alive(map, p[2]));
  CHECK(traits::alive(map, p[1]));
  std::vector<turbomap::recent_point<point>> none;
  CHECK(turbomap::cull_recent_points(map, none, 0).dropped == 0);
}

TEST_CASE("the points of slots can be watched: a name of no point is passed over") {
  using policy = turbomap::context<>::policy_type;
  using traits = turbomap::map_traits<pointer_map>;
  pointer_map map;
  turbomap::context<> ctx;
  turbomap::store_of<pointer_map, policy> store;
  const turbomap::handle_table stored;
  turbomap::guard_times held;
  const turbomap::mapping_scope<pointer_map, policy> scope{ctx, map, store, stored, held};
  const auto k = insert_keyframe(map, std::vector<turbomap::keypoint>(1, make_keypoint(0)), 0, nullptr);
  const traits::point slots[] = {nullptr, traits::add_point(map, {}, k), nullptr};
  turbomap::point_culling<pointer_map, policy> probation;
  probation.watch({slots, 3}, 0);
  CHECK(probation(scope, 2, {}).dropped == 1);
  turbomap::named_points<pointer_map> named;
  named.add({slots, 3});
  CHECK(named.take(turbomap::working_map<pointer_map>(map)).size() == 1);
}

TEST_CASE("points that tracking does not find go at once") {
  flat_map map;
  std::vector<turbomap::recent_point<turbomap::map_point_id>> recent;
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> visible_found{
      {4, 1}, {5, 1}, {100, 24}, {100, 25}, {0, 0}};
  for (const auto& [visible, found] : visible_found) {
    recent.push_back({map.add_point({}), 0});
    map.seen_in_tracking(recent.back().point, visible, found);
  }
  const auto all = recent;
  CHECK(turbomap::cull_recent_points(map, recent, 0).dropped == 2);
  CHECK(map.alive(all[0].point));
  CHECK_FALSE(map.alive(all[1].point));
  CHECK_FALSE(map.alive(all[2].point));
  CHECK(map.alive(all[3].point));
  CHECK(map.alive(all[4].point));  // never expected: no ratio to judge by
  // A point named twice is dropped once.
  recent = {{all[0].point, 0}, {all[0].point, 0}};
  CHECK(turbomap::cull_recent_points(map, recent, 2).dropped == 1);
  CHECK(recent.empty());
}

TEST_CASE("random rounds against the definition") {
  std::mt19937 random(8);
  for (int round = 0; round < 200; ++round) {
    flat_map map;
    map_oracle oracle;
    const auto keypoints = random_keypoints(static_cast<std::uint32_t>(random()), 2, 8, 20);
    std::vector<turbomap::map_keyframe_id> k;
    for (oracle_id i = 0; i < 4; ++i) {
      k.push_back(map.add_keyframe(keypoints, {}));
      oracle.keyframes[i] = {keypoints, 0};
    }
    std::vector<turbomap::map_point_id> p;
    std::vector<turbomap::recent_point<turbomap::map_point_id>> recent;
    std::vector<oracle_recent> expected;
    std::map<oracle_id, float> ratio;
    for (oracle_id i = 0; i < 15; ++i) {
      p.push_back(map.add_point({}, k[0]));
      oracle.points[i] = {oracle_id{0}, {}};
      for (int n = static_cast<int>(random() % 6); n > 0; --n) {
        const std::size_t at = random() % 4, which = random() % keypoints.size();
        CHECK(turbomap::observe(map, p[i], k[at], which) == oracle.observe(i, {at, which}));
      }
      const std::uint32_t visible = 1 + random() % 9, found = random() % 5;
      map.seen_in_tracking(p[i], visible, found);
      ratio[i] = static_cast<float>(found) / static_cast<float>(visible);
      const auto since = static_cast<std::int64_t>(random() % 5);
      recent.push_back({p[i], since}), expected.push_back({i, since});
    }
    const std::size_t size = recent.size();
    const auto summary = turbomap::cull_recent_points(map, recent, 4);
    const auto dead = cull_points_by_definition(oracle, expected, 4, ratio, 0.25F, 3, 2, 3);
    CHECK(summary.dropped == dead.size());
    CHECK(summary.released == size - dead.size() - expected.size());
    REQUIRE(recent.size() == expected.size());
    for (std::size_t i = 0; i < recent.size(); ++i) CHECK(recent[i].point == p[expected[i].point]);
    for (oracle_id i = 0; i < 15; ++i) CHECK(map.alive(p[i]) == (dead.count(i) == 0));
  }
}

TEST_CASE("bad options are refused") {
  flat_map map;
  std::vector<turbomap::recent_point<turbomap::map_point_id>> recent{{map.add_point({}), 0}};
  const auto refuses = [&](auto change) {
    turbomap::map_point_culling_options o;
    change(o);
    CHECK_THROWS_AS(turbomap::cull_recent_points(map, recent, 9, o), std::invalid_argument);
    CHECK(recent.size() == 1);
    CHECK(map.point_count() == 1);
  };
  refuses([](auto& o) { o.min_found_ratio = -0.1F; });
  refuses([](auto& o) { o.min_found_ratio = std::numeric_limits<float>::quiet_NaN(); });
  refuses([](auto& o) { o.patience = -1; });
  refuses([](auto& o) { o.probation = 1; });
  turbomap::map_point_culling_options least;
  least.min_found_ratio = 0, least.patience = least.probation = 0;
  CHECK(turbomap::cull_recent_points(map, recent, 0, least).dropped == 1);  // by its measurements, at once
}

}  // namespace
