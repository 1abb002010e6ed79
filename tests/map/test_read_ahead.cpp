// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Reading ahead visits the same points in the same order as a plain loop, in maps that can prefetch and in others.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/read_ahead.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

/// Notes what prefetch() is called with.
struct asked_map : flat_map {
  mutable std::vector<turbomap::map_point_id> entries, views;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::asked_map> : turbomap::map_traits<turbomap_test::flat_map> {
  static void prefetch(const turbomap_test::asked_map& m, point p, unsigned what) {
    ((what & static_cast<unsigned>(point_data::views)) != 0 ? m.views : m.entries).push_back(p);
  }
};

namespace {

using namespace turbomap_test;
using turbomap::point_data;

static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_prefetch_member>);
static_assert(!turbomap::detail::map_has_v<pointer_map, turbomap::detail::map_prefetch_member>);

TEST_CASE_TEMPLATE("slots are visited in order, empty ones too", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  constexpr unsigned everything = point_data::entry + point_data::views | static_cast<unsigned>(point_data::appearance);
  for (const std::size_t keypoints : {0, 1, 7, 8, 9, 16, 17, 40}) {
    Map map;
    const auto k = insert_keyframe(map, std::vector<turbomap::keypoint>(keypoints), 0, typename traits::keyframe{});
    std::vector<typename traits::point> expected(keypoints), visited;
    for (std::size_t i = 0; i < keypoints; i += 1 + i % 3) {
      expected[i] = traits::add_point(map, {}, k);
      REQUIRE(turbomap::observe(map, expected[i], k, i));
    }
    bool in_order = true;
    turbomap::for_each_slot_ahead<everything>(map, k, [&](std::size_t i, const auto& point) {
      in_order = in_order && i == visited.size();
      visited.push_back(point);
    });
    CHECK(in_order);
    CHECK(visited == expected);
  }
}

TEST_CASE("names of nothing, and of what is gone, may be asked for") {
  using traits = turbomap::map_traits<flat_map>;
  flat_map map;
  const auto k = insert_keyframe(map, std::vector<turbomap::keypoint>(1), 0, turbomap::map_keyframe_id{});
  const auto gone = traits::add_point(map, {}, k);
  turbomap::erase_point(map, gone);
  const turbomap::map_point_id beyond{1000000, 1};
  std::vector<turbomap::map_point_id> names(40);  // more than are looked ahead
  for (std::size_t i = 0; i < names.size(); i += 2) names[i] = i % 4 == 0 ? gone : beyond;
  std::size_t asked = 0, visits = 0;
  turbomap::for_each_ahead<point_data::entry + point_data::views>(
      map, names.size(), [&](std::size_t i) { return names[i]; }, [&](std::size_t, const auto&) { ++visits; },
      [&](const auto&) { ++asked; });
  CHECK(visits == names.size());
  CHECK(asked == names.size() / 2);  // not for none
}

TEST_CASE("traits are asked for each name once, in order, and never for none") {
  const asked_map map;
  std::vector<turbomap::map_point_id> names(40), expected;
  for (std::int32_t i = 0; i < 40; ++i)
    if (i % 3 != 0) expected.push_back(names[static_cast<std::size_t>(i)] = {i, 0});
  turbomap::for_each_ahead<point_data::entry + point_data::views>(
      map, names.size(), [&](std::size_t i) { return names[i]; }, [](std::size_t, const auto&) {});
  CHECK(map.entries == expected);
  // The first ones are worked on before a list could have come.
  const auto near = static_cast<std::ptrdiff_t>(turbomap::detail::ahead_near);
  expected.erase(std::remove_if(expected.begin(), expected.end(), [&](const auto& p) { return p.index < near; }),
                 expected.end());
  CHECK(map.views == expected);
}

}  // namespace
