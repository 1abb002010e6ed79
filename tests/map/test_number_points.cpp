// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Points in the slots of several keyframes are numbered in the order in which they are met, each once; parts of a keyframe make
/// no difference; a dead point in a slot has no number where ids are asked for, and does no harm where indices are.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/number_points.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("each point once, in the order of slots", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  using point = typename traits::point;
  std::mt19937 random(3);
  Map map;
  std::vector<typename traits::keyframe> keyframes;
  for (int k = 0; k < 6; ++k)
    keyframes.push_back(insert_keyframe(map, random_keypoints(static_cast<std::uint32_t>(k), 1, 8, 60), k,
                                        k == 0 ? typename traits::keyframe{} : keyframes.back()));
  std::vector<point> points;
  for (int p = 0; p < 40; ++p) points.push_back(traits::add_point(map, {}, keyframes[0]));
  for (int i = 0; i < 400; ++i)
    turbomap::observe(map, points[random() % points.size()], keyframes[random() % keyframes.size()], random() % 60);
  const point dead = traits::add_point(map, {}, keyframes[0]);
  traits::retire(map, dead, point{});
  for (std::size_t i = 0; i < 60; ++i)
    if (traits::point_at(map, keyframes[2], i) == point{}) {
      traits::set_point(map, keyframes[2], i, dead);  // no edit does this
      break;
    }

  turbomap::point_numbering<Map> numbers;
  turbomap::list_of<point> scratch;
  std::vector<point> expected, found;
  for (std::size_t part : {60U, 7U, 1U}) {
    numbers.clear(), expected.clear(), found.clear();
    for (const auto& k : keyframes) {
      for (std::size_t begin = 0; begin < 60; begin += part)
        turbomap::number_points_of(map, k, begin, std::min(begin + part, std::size_t{60}), numbers, scratch,
                                   [&](const point& p, std::size_t number, bool is_new) {
                                     CHECK(is_new == (number == found.size()));
                                     if (is_new) found.push_back(p);
                                     CHECK(found[number] == p);
                                   });
      for (std::size_t i = 0; i < 60; ++i) {
        const point p = traits::point_at(map, k, i);
        const bool counts = !(p == point{}) && (turbomap::point_numbering<Map>::indexed || traits::alive(map, p));
        if (counts && std::find(expected.begin(), expected.end(), p) == expected.end()) expected.push_back(p);
      }
    }
    CHECK(found == expected);
    CHECK(numbers.size() == expected.size());
  }
  CHECK(expected.size() > 30);
  turbomap::number_points_of(map, keyframes[0], 5, 5, numbers, scratch,
                             [](const point&, std::size_t, bool) { FAIL_CHECK("of no slots"); });
}

}  // namespace
