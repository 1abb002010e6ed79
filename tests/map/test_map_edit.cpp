// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Each edit by itself: what it does, what it refuses, and that a refusal changes nothing. Edits in all orders are in
/// test_map_properties.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/fusion_commit.hpp>

#include <cstddef>
#include <limits>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"
#include "support/counted_new.hpp"

namespace {

using namespace turbomap_test;
using turbomap::merge_rule;

/// Keyframes of two cameras with three keypoints each, octave = number, and points.
template <class Map>
struct scene {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  Map map;
  std::vector<keyframe> k;
  std::vector<point> p;
  std::vector<std::pair<keyframe, std::size_t>> scratch;

  scene(std::size_t keyframes, std::size_t points) {
    std::vector<turbomap::keypoint> rig;
    for (int i = 0; i < 6; ++i) rig.push_back(make_keypoint(i, i / 3));
    for (std::size_t i = 0; i < keyframes; ++i) k.push_back(insert_keyframe(map, rig, 0, keyframe{}));
    for (std::size_t i = 0; i < points; ++i) p.push_back(traits::add_point(map, {}, k[0]));
  }
  bool observe(std::size_t point, std::size_t keyframe, std::size_t i) {
    return turbomap::observe(map, p[point], k[keyframe], i);
  }
  point at(std::size_t keyframe, std::size_t i) const { return traits::point_at(map, k[keyframe], i); }
  std::size_t views(std::size_t point) const {
    std::size_t n = 0;
    traits::for_each_observation(map, p[point], [&n](auto, std::size_t) { ++n; });
    return n;
  }
  bool merge(std::size_t from, std::size_t into, merge_rule rule = merge_rule::refuse) {
    return turbomap::merge_points(map, p[from], p[into], rule, scratch);
  }
};

TEST_CASE_TEMPLATE("a slot holds one point, and a camera sees a point once", Map, flat_map, pointer_map) {
  scene<Map> s(2, 2);
  CHECK(s.observe(0, 0, 1));
  CHECK_FALSE(s.observe(1, 0, 1));  // the slot is taken
  CHECK_FALSE(s.observe(0, 0, 1));
  CHECK_FALSE(s.observe(0, 0, 0));  // seen by this camera already
  CHECK(s.observe(0, 0, 4));        // the other camera
  CHECK_FALSE(s.observe(0, 0, 3));
  CHECK(s.observe(0, 1, 3));
  CHECK(s.observe(1, 0, 0));
  CHECK(s.views(0) == 3);
  CHECK(s.views(1) == 1);
  CHECK(s.at(0, 1) == s.p[0]);
  CHECK(s.at(0, 0) == s.p[1]);
  CHECK(s.at(0, 3) == typename scene<Map>::point{});
}

TEST_CASE_TEMPLATE("a reference keyframe that loses its last view hands over to the oldest observer", Map, flat_map,
                   pointer_map) {
  scene<Map> s(4, 1);
  using traits = turbomap::map_traits<Map>;
  s.observe(0, 0, 0), s.observe(0, 0, 3), s.observe(0, 3, 0), s.observe(0, 1, 0), s.observe(0, 2, 0);
  CHECK(turbomap::forget(s.map, s.k[0], 1) == typename traits::point{});  // an empty slot
  CHECK(turbomap::forget(s.map, s.k[0], 0) == s.p[0]);
  CHECK(traits::reference(s.map, s.p[0]) == s.k[0]);  // its other camera still sees it
  turbomap::forget(s.map, s.k[3], 0);
  CHECK(traits::reference(s.map, s.p[0]) == s.k[0]);
  turbomap::forget(s.map, s.k[0], 3);
  CHECK(traits::reference(s.map, s.p[0]) == s.k[1]);
  turbomap::erase_keyframe(s.map, s.k[1], 0);
  CHECK(traits::reference(s.map, s.p[0]) == s.k[2]);
  turbomap::forget(s.map, s.k[2], 0);
  CHECK(traits::alive(s.map, s.p[0]));  // without observations, but there
  CHECK(s.views(0) == 0);
}

TEST_CASE_TEMPLATE("a point fades with the last views", Map, flat_map, pointer_map) {
  scene<Map> s(4, 1);
  using traits = turbomap::map_traits<Map>;
  for (std::size_t i = 0; i < 4; ++i) s.observe(0, i, 0);
  CHECK_FALSE(turbomap::fade(s.map, s.k[0], 1));  // an empty slot
  CHECK_FALSE(turbomap::fade(s.map, s.k[0], 0));  // three are left
  CHECK_FALSE(turbomap::fade(s.map, s.k[1], 0, 1));
  CHECK(traits::alive(s.map, s.p[0]));
  CHECK(s.views(0) == 2);
  CHECK(turbomap::fade(s.map, s.k[2], 0));
  CHECK_FALSE(traits::alive(s.map, s.p[0]));
  CHECK(s.at(3, 0) == typename traits::point{});
  CHECK(traits::replacement(s.map, s.p[0]) == typename traits::point{});
}

TEST_CASE_TEMPLATE("a point that is erased leaves every slot, however many see it", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  for (const int observers : {0, 1, 15, 16, 17, 40}) {
    Map map;
    std::vector<typename traits::keyframe> k;
    const std::vector<turbomap::keypoint> keypoints{make_keypoint(0), make_keypoint(1)};
    for (int i = 0; i < 40; ++i) k.push_back(insert_keyframe(map, keypoints, i, typename traits::keyframe{}));
    const auto goes = traits::add_point(map, {}, k[0]), stays = traits::add_point(map, {}, k[0]);
    for (int i = 0; i < 40; ++i) {
      const auto at = static_cast<std::size_t>(i);
      REQUIRE(turbomap::observe(map, stays, k[at], 1));
      if (i < observers) REQUIRE(turbomap::observe(map, goes, k[at], 0));
    }
    turbomap::erase_point(map, goes);
    CHECK_FALSE(traits::alive(map, goes));
    for (const auto& keyframe : k) {
      CHECK(traits::point_at(map, keyframe, 0) == typename traits::point{});
      CHECK(traits::point_at(map, keyframe, 1) == stays);
    }
    CHECK(turbomap::measurement_count(map, stays) == 40);
    CHECK(turbomap::require_consistent(map, stays));
  }
}

TEST_CASE_TEMPLATE("an observation moves to a free keypoint of its own camera, or of one that sees nothing", Map,
                   flat_map, pointer_map) {
  scene<Map> s(2, 2);
  s.observe(0, 0, 0), s.observe(1, 0, 1);
  CHECK_FALSE(turbomap::move_observation(s.map, s.k[0], 2, 1));  // nothing there
  CHECK_FALSE(turbomap::move_observation(s.map, s.k[0], 0, 1));  // taken
  CHECK_FALSE(turbomap::move_observation(s.map, s.k[0], 0, 0));
  CHECK(turbomap::move_observation(s.map, s.k[0], 0, 2));
  CHECK(s.at(0, 2) == s.p[0]);
  CHECK(s.at(0, 0) == typename scene<Map>::point{});
  CHECK(turbomap::move_observation(s.map, s.k[0], 2, 4));  // to the other camera
  CHECK(turbomap::observe(s.map, s.p[0], s.k[0], 0));
  CHECK_FALSE(turbomap::move_observation(s.map, s.k[0], 0, 3));  // that camera sees it by keypoint 4
  CHECK(turbomap::move_observation(s.map, s.k[0], 4, 3));
  CHECK(s.views(0) == 2);
  CHECK(turbomap::finest_octave(s.map, s.p[0], s.k[0]) == 0);
}

TEST_CASE_TEMPLATE("a merge moves every observation, or is refused", Map, flat_map, pointer_map) {
  scene<Map> s(3, 3);
  using traits = turbomap::map_traits<Map>;
  s.observe(0, 0, 0), s.observe(0, 1, 0), s.observe(1, 1, 3), s.observe(1, 2, 0), s.observe(2, 0, 1);
  CHECK_FALSE(s.merge(0, 0));
  CHECK_FALSE(turbomap::seen_apart(s.map, s.p[0], s.p[1]));  // keyframe 1 sees them by two cameras
  CHECK(s.merge(0, 1));
  CHECK_FALSE(traits::alive(s.map, s.p[0]));
  CHECK(traits::replacement(s.map, s.p[0]) == s.p[1]);
  CHECK(s.views(1) == 4);
  CHECK(s.at(0, 0) == s.p[1]);
  CHECK(s.at(1, 0) == s.p[1]);
  CHECK(turbomap::seen_apart(s.map, s.p[1], s.p[2]));
  CHECK(turbomap::seen_apart(s.map, s.p[2], s.p[1]));
  CHECK_FALSE(s.merge(2, 1));  // keyframe 0 sees them apart
  CHECK(s.views(1) == 4);
  CHECK(s.views(2) == 1);
  CHECK(traits::alive(s.map, s.p[2]));
  CHECK(s.merge(1, 2, merge_rule::drop));
  CHECK(s.views(2) == 4);
  CHECK(s.at(0, 0) == typename traits::point{});  // dropped: the survivor's own view stays
  CHECK(s.at(0, 1) == s.p[2]);
  CHECK(turbomap::resolve(s.map, s.p[0]) == s.p[2]);  // a chain
  CHECK(turbomap::resolve(s.map, s.p[2]) == s.p[2]);
  CHECK(turbomap::resolve(s.map, typename traits::point{}) == typename traits::point{});
  turbomap::erase_point(s.map, s.p[2]);
  CHECK(turbomap::resolve(s.map, s.p[0]) == typename traits::point{});
  for (std::size_t i = 0; i < 6; ++i) CHECK(s.at(1, i) == typename traits::point{});
  // The counts went with the observations, also of points that are gone.
  if constexpr (turbomap::counts_octaves_v<Map>)
    for (const auto p : s.p)
      for (const auto count : traits::octave_counts(s.map, p)) CHECK(count == 0);
}

TEST_CASE("chains of replacements that run in circles end") {
  scene<pointer_map> s(1, 9);
  for (std::size_t i = 0; i < 9; ++i) s.p[i]->bad = true;
  for (std::size_t i = 0; i < 9; ++i)
    for (std::size_t back = 0; back <= i; ++back) {  // 0 -> 1 ... -> i -> back
      for (std::size_t j = 0; j < i; ++j) s.p[j]->replaced = s.p[j + 1];
      s.p[i]->replaced = s.p[back];
      for (std::size_t j = 0; j <= i; ++j) CHECK(turbomap::resolve(s.map, s.p[j]) == nullptr);
    }
  for (std::size_t j = 0; j < 8; ++j) s.p[j]->replaced = s.p[j + 1];
  s.p[8]->bad = false;
  for (std::size_t j = 0; j < 9; ++j) CHECK(turbomap::resolve(s.map, s.p[j]) == s.p[8]);
}

TEST_CASE_TEMPLATE("a keyframe that goes names each point that lives on, once", Map, flat_map, pointer_map) {
  scene<Map> s(4, 4);
  using traits = turbomap::map_traits<Map>;
  // Point 0: both cameras of keyframe 0 and three others. Point 1: two others. Point 2: both cameras and two others.
  // Point 3: nobody.
  s.observe(0, 0, 0), s.observe(0, 0, 3), s.observe(0, 1, 0), s.observe(0, 2, 0), s.observe(0, 3, 0);
  s.observe(1, 0, 1), s.observe(1, 1, 1), s.observe(1, 2, 1);
  s.observe(2, 0, 2), s.observe(2, 0, 4), s.observe(2, 1, 2), s.observe(2, 2, 2);
  std::vector<typename traits::point> touched;
  turbomap::erase_keyframe(s.map, s.k[0], 2, &touched);
  CHECK(touched == std::vector<typename traits::point>{s.p[0]});
  CHECK_FALSE(traits::alive(s.map, s.k[0]));
  CHECK(traits::alive(s.map, s.p[0]));
  CHECK_FALSE(traits::alive(s.map, s.p[1]));  // two are left: it dies
  CHECK_FALSE(traits::alive(s.map, s.p[2]));
  CHECK(traits::alive(s.map, s.p[3]));
  CHECK(s.views(0) == 3);
  // The counts by octave too: the two views went one after the other.
  if constexpr (std::is_same_v<Map, flat_map>) CHECK(turbomap::validate(s.map).empty());
  turbomap::erase_keyframe(s.map, s.k[1], 1);
  CHECK(s.views(0) == 2);
}

TEST_CASE("out of memory: an edit is done or not begun") {
  int refused = 0;
  for (long until = 0;; ++until) {
    scene<flat_map> s(12, 2);
    for (std::size_t i = 0; i < 6; ++i) s.observe(0, i, 0), s.observe(1, 6 + i, 0);
    const auto before = everything(s.map);
    allocations_left = until;
    bool done = true;
    try {
      s.merge(0, 1);
      for (std::size_t i = 6; i < 12; ++i) turbomap::move_observation(s.map, s.k[i], 0, 1);  // needs no memory
      turbomap::erase_keyframe(s.map, s.k[0]);
    } catch (const std::bad_alloc&) {
      done = false;
    }
    allocations_left = no_limit;
    if (done) break;
    ++refused;
    CHECK(everything(s.map) == before);
  }
  CHECK(refused > 1);  // scratch and the list
}

TEST_CASE("out of memory in a commit: before it, or between two entries") {
  using entry = turbomap::duplicate<std::int32_t>;
  const std::vector<entry> plan{{9, 1, 2, 4, 1}, {0, 0, 1, 0, 1}, {0, 1, 0, 4, 1},
                                {1, 1, 0, 4, 1}, {7, 0, 2, 0, 1}, {2, 1, 2, 4, 1}};
  int refused = 0, cut = 0;
  for (long until = 0;; ++until) {
    scene<flat_map> s(12, 3);
    for (std::size_t i = 0; i < 6; ++i) s.observe(0, i, 0), s.observe(1, 6 + i, 0);
    s.observe(2, 3, 1);
    const auto before = everything(s.map);
    turbomap::fusion_commit<flat_map> commit;
    allocations_left = until;
    bool done = true;
    try {
      commit(s.map, turbomap::span<const entry>(plan), turbomap::span<const turbomap::map_keyframe_id>(s.k),
             turbomap::span<const turbomap::map_point_id>(s.p));
    } catch (const std::bad_alloc&) {
      done = false;
    }
    allocations_left = no_limit;
    CHECK(turbomap::validate(s.map).empty());
    for (std::size_t i = 0; i < 12; ++i) CHECK(s.at(i, 0) != turbomap::map_point_id{});  // nothing is lost
    if (done) break;
    ++(everything(s.map) == before ? refused : cut);
  }
  CHECK(refused > 3);
  CHECK(cut > 0);
}

}  // namespace
