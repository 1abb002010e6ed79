// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Accepted points of a plan become points of a map: who gets a keypoint, what is refused.

#include <doctest/doctest.h>

#include <turbomap/mapping/map_mirror.hpp>  // first: what looks into a mirror must not hide what looks at a map

#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/creation_commit.hpp>
#include <turbomap/matching/first_claims.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

/// There is no memory for the observations of one of the points.
struct crowded_map : flat_map {
  int reserves_left = 0;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::crowded_map> : turbomap::map_traits<turbomap_test::flat_map> {
  static void reserve_observations(turbomap_test::crowded_map& m, point p, std::size_t more) {
    if (m.reserves_left-- <= 0) throw std::bad_alloc();
    turbomap::map_traits<turbomap_test::flat_map>::reserve_observations(m, p, more);
  }
};

namespace {

using namespace turbomap_test;
using turbomap::creation_outcome;

/// A query, its neighbours, and plans by (neighbour, query keypoint, candidate).
template <class Map>
struct creation {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  Map map;
  keyframe query{};
  std::vector<keyframe> neighbours;
  std::vector<point> created;
  turbomap::computed_appearances<typename traits::descriptor> looks;  ///< of the next plan; none by default

  explicit creation(std::size_t count = 2, std::size_t keypoints = 4) {
    const std::vector<turbomap::keypoint> all(keypoints, make_keypoint(1));
    query = insert_keyframe(map, all, 0, keyframe{});
    for (std::size_t i = 0; i < count; ++i) neighbours.push_back(insert_keyframe(map, all, 0, keyframe{}));
  }
  static turbomap::created_point entry(std::int32_t neighbour, std::int32_t q, std::int32_t c,
                                       creation_outcome outcome = creation_outcome::accepted) {
    return {neighbour, q, c, outcome, turbomap::creation_method::triangulated, {1.0 + neighbour, 2.0 + q, 3.0 + c}};
  }
  void run(const std::vector<turbomap::created_point>& plan) {
    turbomap::commit_points<Map>(map, plan, looks, query, neighbours, created);
  }
  point at(keyframe k, std::size_t i) const { return traits::point_at(map, k, i); }
};

TEST_CASE_TEMPLATE("an accepted point is seen by both, and is of the query", Map, flat_map, pointer_map) {
  creation<Map> c;
  using traits = turbomap::map_traits<Map>;
  c.run({c.entry(0, 1, 2), c.entry(1, 0, 3, creation_outcome::low_parallax)});
  REQUIRE(c.created.size() == 1);
  CHECK(c.at(c.query, 1) == c.created[0]);
  CHECK(c.at(c.neighbours[0], 2) == c.created[0]);
  CHECK(c.at(c.query, 0) == typename traits::point{});
  CHECK(traits::reference(c.map, c.created[0]) == c.query);
  CHECK(traits::position(c.map, c.created[0]).y == 3);
  c.run({c.entry(1, 0, 3)});
  CHECK(c.created.size() == 2);  // appended
  c.run({});
  CHECK(c.created.size() == 2);
}

TEST_CASE("a point for whose observations there is no memory is not in the map, those before it are") {
  creation<crowded_map> c;
  c.map.reserves_left = 1;
  CHECK_THROWS_AS(c.run({c.entry(0, 1, 2), c.entry(1, 0, 3)}), std::bad_alloc);
  REQUIRE(c.created.size() == 1);
  CHECK(c.map.point_count() == 1);
  CHECK(c.map.observations(c.created[0]).size() == 2);
  CHECK(c.at(c.query, 0) == turbomap::map_point_id{});
  CHECK(turbomap::validate(c.map).empty());
}

TEST_CASE_TEMPLATE("points enter the map with their appearance", Map, flat_map, pointer_map) {
  creation<Map> c;
  using traits = turbomap::map_traits<Map>;
  constexpr auto elements = static_cast<std::size_t>(traits::descriptor::elements);
  const std::vector<turbomap::point_appearance> looks{{{0, 0, 1}, 1, 4, 0}, {{0, 1, 0}, 2, 8, 0}, {{1, 0, 0}, 3, 9, 0}};
  std::vector<typename traits::descriptor::element> descriptors(3 * elements);
  for (std::size_t i = 0; i < descriptors.size(); ++i)
    descriptors[i] = static_cast<typename traits::descriptor::element>(i);
  c.looks = {looks, descriptors};
  c.run({c.entry(0, 0, 0), c.entry(1, 1, 0, creation_outcome::scale), c.entry(1, 2, 1)});
  REQUIRE(c.created.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t entry = 2 * i;  // the second one was not accepted
    const auto p = c.created[i];
    CHECK(traits::min_distance(c.map, p) == looks[entry].min_distance);
    CHECK(traits::max_distance(c.map, p) == looks[entry].max_distance);
    CHECK(traits::normal(c.map, p).x == looks[entry].normal.x);
    CHECK(std::equal(descriptors.begin() + static_cast<std::ptrdiff_t>(entry * elements),
                     descriptors.begin() + static_cast<std::ptrdiff_t>((entry + 1) * elements),
                     traits::descriptor_data(c.map, p)));
  }
  CHECK_THROWS_AS(c.run({c.entry(0, 3, 3)}), std::invalid_argument);  // not as many
}

TEST_CASE_TEMPLATE("a keypoint gets one point: of the first entry, or the one that it had", Map, flat_map,
                   pointer_map) {
  creation<Map> c;
  using traits = turbomap::map_traits<Map>;
  const auto mine = traits::add_point(c.map, {}, c.query);
  CHECK(turbomap::observe(c.map, mine, c.neighbours[1], 3));
  // The same query keypoint twice; the same candidate twice; a candidate that was taken since the search.
  c.run({c.entry(0, 0, 0), c.entry(1, 0, 1), c.entry(0, 1, 0), c.entry(1, 2, 3), c.entry(1, 3, 1)});
  CHECK(c.created.size() == 2);
  CHECK(c.at(c.query, 0) == c.created[0]);
  CHECK(c.at(c.neighbours[0], 0) == c.created[0]);
  CHECK(c.at(c.query, 1) == typename traits::point{});
  CHECK(c.at(c.query, 2) == typename traits::point{});
  CHECK(c.at(c.neighbours[1], 3) == mine);
  CHECK(c.at(c.query, 3) == c.created[1]);
  CHECK(c.at(c.neighbours[1], 1) == c.created[1]);
}

TEST_CASE_TEMPLATE("keyframes that are gone since the search get nothing", Map, flat_map, pointer_map) {
  creation<Map> c;
  turbomap::erase_keyframe(c.map, c.neighbours[0]);
  c.run({c.entry(0, 0, 0), c.entry(0, 1, 1000), c.entry(1, 1, 1)});
  CHECK(c.created.size() == 1);
  CHECK(c.at(c.query, 1) == c.created[0]);
  turbomap::erase_keyframe(c.map, c.query);
  c.run({c.entry(1, 2, 2)});
  CHECK(c.created.size() == 1);
}

TEST_CASE("bad plans are refused with the map as it was") {
  creation<flat_map> c;
  const auto before = everything(c.map);
  constexpr std::int32_t most = std::numeric_limits<std::int32_t>::max();
  for (const std::array<std::int32_t, 3> bad :
       {std::array{-1, 0, 0}, std::array{2, 0, 0}, std::array{most, 0, 0}, std::array{0, -1, 0}, std::array{0, 4, 0},
        std::array{0, 0, -1}, std::array{0, 0, 4}, std::array{1, 1, most}})
    CHECK_THROWS_AS(c.run({c.entry(0, 2, 2), c.entry(bad[0], bad[1], bad[2])}), std::invalid_argument);
  CHECK_THROWS_AS(c.run({c.entry(0, 2, 2), c.entry(2, 0, 0, creation_outcome::scale)}), std::invalid_argument);
  CHECK(everything(c.map) == before);
  CHECK(c.created.empty());
  CHECK_THROWS_WITH_AS(c.run({c.entry(0, 0, 4)}),
                       "turbomap: observations[].keypoint = 4: is not a keypoint of the keyframe",
                       std::invalid_argument);
}

TEST_CASE("slots that contradict the map are refused before the first point is made") {
  creation<lying_map> c;
  const auto stranger = c.map.add_point({}, c.query);
  const auto before = everything(c.map);
  for (const auto k : {c.query, c.neighbours[1]}) {
    c.map.slots[{k.index, 2}] = stranger;
    c.map.writes = 0;
    CHECK_THROWS_AS(c.run({c.entry(0, 0, 0), c.entry(1, 2, 2)}), turbomap::inconsistent_map);
    CHECK(c.map.writes == 0);
    c.map.tell_the_truth();
  }
  CHECK(everything(c.map) == before);
  c.run({c.entry(0, 0, 0), c.entry(1, 2, 2)});
  CHECK(c.created.size() == 2);
}

/// Points with any number of views: (number of a keyframe, keypoint) each; number 0 is the query.
template <class Map>
struct views_of_points {
  std::vector<turbomap::vec3<double>> positions;
  std::vector<std::int32_t> offsets{0};
  std::vector<turbomap::point_observation> observations;

  void add(const std::vector<turbomap::point_observation>& views) {
    positions.push_back({static_cast<double>(positions.size()), 2, 3});
    observations.insert(observations.end(), views.begin(), views.end());
    offsets.push_back(static_cast<std::int32_t>(observations.size()));
  }
  /// \return the points that are due
  std::vector<typename creation<Map>::point> commit(creation<Map>& c) const {
    std::vector<typename creation<Map>::keyframe> keyframes{c.query};
    keyframes.insert(keyframes.end(), c.neighbours.begin(), c.neighbours.end());
    std::vector<typename creation<Map>::point> due;
    turbomap::commit_points<Map>(c.map, turbomap::new_points_view{positions, offsets, observations}, c.looks, keyframes,
                                 c.created, due);
    return due;
  }
};

TEST_CASE_TEMPLATE("a point enters with the views that are possible, if these are two", Map, flat_map, pointer_map) {
  creation<Map> c(4);
  using traits = turbomap::map_traits<Map>;
  const auto mine = traits::add_point(c.map, {}, c.query);
  CHECK(turbomap::observe(c.map, mine, c.neighbours[1], 3));
  turbomap::erase_keyframe(c.map, c.neighbours[3]);
  views_of_points<Map> plan;
  plan.add({{0, 0}, {1, 0}, {2, 0}});     // all three
  plan.add({{0, 1}, {1, 1}, {2, 3}});     // one keypoint has a point
  plan.add({{0, 2}, {2, 3}, {4, 1000}});  // one more is of a keyframe that is gone: one is left
  plan.add({{0, 0}, {1, 2}, {3, 2}});     // the query's keypoint went to the first
  plan.add({{0, 2}, {1, 3}});             // what the third did not take
  const auto due = plan.commit(c);
  REQUIRE(c.created.size() == 4);
  REQUIRE(due.size() == 2);
  CHECK((due[0] == c.created[1] && due[1] == c.created[2]));
  CHECK(traits::reference(c.map, c.created[0]) == c.query);
  CHECK(traits::reference(c.map, c.created[2]) == c.neighbours[0]);
  CHECK((c.at(c.neighbours[1], 0) == c.created[0] && c.at(c.neighbours[1], 3) == mine));
  CHECK((c.at(c.neighbours[0], 2) == c.created[2] && c.at(c.neighbours[2], 2) == c.created[2]));
  CHECK((c.at(c.query, 2) == c.created[3] && c.at(c.neighbours[0], 3) == c.created[3]));
  if constexpr (std::is_same_v<Map, flat_map>) CHECK(turbomap::validate(c.map).empty());
}

TEST_CASE_TEMPLATE("a keyframe that is named twice sees a point once", Map, flat_map, pointer_map) {
  creation<Map> c(2);
  c.neighbours[1] = c.neighbours[0];
  views_of_points<Map> plan;
  plan.add({{0, 0}, {1, 1}, {2, 2}});
  plan.commit(c);
  REQUIRE(c.created.size() == 1);
  CHECK(c.at(c.neighbours[0], 1) == c.created[0]);
  CHECK(c.at(c.neighbours[0], 2) == typename turbomap::map_traits<Map>::point{});
  if constexpr (std::is_same_v<Map, flat_map>) CHECK(turbomap::validate(c.map).empty());
}

TEST_CASE_TEMPLATE("a camera sees a point once: its second keypoint is no second view", Map, flat_map, pointer_map) {
  creation<Map> c;
  using none = typename turbomap::map_traits<Map>::point;
  c.query = insert_keyframe(c.map, {make_keypoint(1), make_keypoint(1), make_keypoint(1, 1), make_keypoint(1)}, 0,
                            typename creation<Map>::keyframe{});
  views_of_points<Map> plan;
  plan.add({{0, 0}, {0, 1}});          // one camera
  plan.add({{0, 0}, {0, 2}});          // two cameras of one keyframe
  plan.add({{0, 1}, {1, 0}, {1, 1}});  // three views, two by one camera: the first of them counts
  const auto due = plan.commit(c);
  REQUIRE(c.created.size() == 2);
  CHECK((c.at(c.query, 0) == c.created[0] && c.at(c.query, 2) == c.created[0]));
  CHECK((c.at(c.query, 1) == c.created[1] && c.at(c.neighbours[0], 0) == c.created[1]));
  CHECK(c.at(c.neighbours[0], 1) == none{});
  REQUIRE(due.size() == 1);
  CHECK(due[0] == c.created[1]);
  if constexpr (std::is_same_v<Map, flat_map>) CHECK(turbomap::validate(c.map).empty());
}

TEST_CASE("bad views are refused with the map as it was") {
  creation<flat_map> c;
  const auto before = everything(c.map);
  for (const turbomap::point_observation bad :
       {turbomap::point_observation{-1, 0}, turbomap::point_observation{3, 0}, turbomap::point_observation{1, -1},
        turbomap::point_observation{1, 4}}) {
    views_of_points<flat_map> plan;
    plan.add({{0, 0}, {1, 0}});
    plan.add({{0, 1}, bad});
    CHECK_THROWS_AS(plan.commit(c), std::invalid_argument);
  }
  views_of_points<flat_map> plan;
  plan.add({{0, 0}, {1, 0}});
  plan.offsets.back() = 3;
  CHECK_THROWS_AS(plan.commit(c), std::invalid_argument);
  plan.offsets.push_back(2);
  CHECK_THROWS_AS(plan.commit(c), std::invalid_argument);
  views_of_points<flat_map> falling;
  falling.add({{0, 0}, {1, 0}});
  falling.add({{0, 1}, {1, 1}});
  falling.offsets = {0, 3, 2};
  CHECK_THROWS_AS(falling.commit(c), std::invalid_argument);
  CHECK(everything(c.map) == before);
  CHECK(c.created.empty());
}

TEST_CASE_TEMPLATE("random plans: what first_claims() says", Map, flat_map, pointer_map) {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    std::mt19937 random(seed);
    constexpr int keypoints = 40, neighbours = 5;
    creation<Map> c(neighbours, keypoints);
    std::vector<turbomap::created_point> plan;
    for (int n = 0; n < neighbours; ++n)
      for (int q = 0; q < keypoints; ++q)
        if (random() % 2 == 0)
          plan.push_back(c.entry(n, q, static_cast<int>(random() % keypoints),
                                 random() % 4 == 0 ? creation_outcome::scale : creation_outcome::accepted));
    const auto expected = turbomap::first_claims(plan, keypoints, std::vector<int>(neighbours, keypoints));
    c.run(plan);
    REQUIRE(c.created.size() == expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const auto& e = expected[i];
      CHECK(c.at(c.query, static_cast<std::size_t>(e.query)) == c.created[i]);
      CHECK(c.at(c.neighbours[static_cast<std::size_t>(e.neighbour)], static_cast<std::size_t>(e.candidate)) ==
            c.created[i]);
      CHECK(turbomap::map_traits<Map>::position(c.map, c.created[i]).z == 3.0 + e.candidate);
    }
  }
}

}  // namespace
