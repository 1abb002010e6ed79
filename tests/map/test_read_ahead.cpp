// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Reading ahead visits the same points in the same order as a plain loop, in maps that can prefetch and in others.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/read_ahead.hpp>

#include <cstddef>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;
using turbomap::point_data;

static_assert(turbomap::detail::map_has_v<flat_map, turbomap::detail::map_prefetch_member>);
static_assert(!turbomap::detail::map_has_v<pointer_map, turbomap::detail::map_prefetch_member>);

TEST_CASE_TEMPLATE("slots are visited in order, empty ones too", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  constexpr unsigned everything =
      point_data::entry + point_data::views | point_data::appearance + point_data::octave_counts;
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
  const std::vector<turbomap::map_point_id> names = {{}, gone, {}, gone};
  std::size_t asked = 0, visits = 0;
  turbomap::for_each_ahead<point_data::entry + point_data::views>(
      map, names.size(), [&](std::size_t i) { return names[i]; }, [&](std::size_t, const auto&) { ++visits; },
      [&](const auto&) { ++asked; });
  CHECK(visits == names.size());
  CHECK(asked == names.size());
}

}  // namespace
