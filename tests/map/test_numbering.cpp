// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Keyframes and points are numbered alike by the map's own indices and through their ids.

#include <doctest/doctest.h>

#include <turbomap/map/numbering.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;

static_assert(turbomap::detail::has_map_index<flat_map, turbomap::map_keyframe_id>::value);
static_assert(turbomap::detail::has_map_index<flat_map, turbomap::map_point_id>::value);
static_assert(!turbomap::detail::has_map_index<pointer_map, pointer_keyframe*>::value);
static_assert(!turbomap::detail::has_map_index<pointer_map, pointer_point*>::value);

TEST_CASE_TEMPLATE("numbers follow the order in which names are first given", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  Map map;
  std::vector<typename traits::keyframe> k;
  std::vector<typename traits::point> p;
  for (int i = 0; i < 300; ++i) {
    k.push_back(insert_keyframe(map, {}, 0, typename traits::keyframe{}));
    p.push_back(traits::add_point(map, {}, k[0]));
  }
  turbomap::keyframe_numbering<Map> keyframes;
  turbomap::point_numbering<Map> points;
  constexpr std::size_t none = turbomap::point_numbering<Map>::none;
  CHECK(points.find(map, p[299]) == none);
  std::mt19937 random(6);
  for (int round = 0; round < 20; ++round) {
    keyframes.clear(), points.clear();
    CHECK(points.size() == 0);
    CHECK(points.find(map, p[0]) == none);
    std::map<std::size_t, std::size_t> truth;
    bool same = true;
    for (int i = 0; i < 200; ++i) {
      const std::size_t name = random() % p.size(), other = random() % p.size();
      const auto expected = truth.insert({name, truth.size()}).first->second;
      same = same && points.place(map, p[name]) == expected && keyframes.place(map, k[name]) == expected;
      const auto at = truth.find(other);
      same = same && points.find(map, p[other]) == (at == truth.end() ? none : at->second);
      same = same && keyframes.find(map, k[other]) == points.find(map, p[other]);
      same = same && points.size() == truth.size() && keyframes.size() == truth.size();
    }
    CHECK(same);
  }
}

}  // namespace
