// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Covisible keyframes: counts of shared points, order, ties, limits. Random maps are in test_map_properties.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/covisibility.hpp>
#include <turbomap/map/map_edit.hpp>

#include <array>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/pointer_map.hpp"

namespace {

using namespace turbomap_test;
using pairs = std::vector<std::pair<std::uint64_t, int>>;

TEST_CASE_TEMPLATE("most shared first, equal ones in order of insertion, a rig's views are one", Map, flat_map,
                   pointer_map) {
  Map map;
  using traits = turbomap::map_traits<Map>;
  std::vector<typename traits::keyframe> k;
  std::vector<typename traits::point> p;
  const std::vector<turbomap::keypoint> rig{make_keypoint(0, 0), make_keypoint(0, 0), make_keypoint(0, 1),
                                            make_keypoint(0, 1)};
  for (int i = 0; i < 5; ++i) k.push_back(insert_keyframe(map, rig, i, typename traits::keyframe{}));
  for (int i = 0; i < 3; ++i) p.push_back(traits::add_point(map, {}, k[0]));
  // Keyframe 3 sees points 0 (twice), 1 and 2; 0 sees 0 twice; 1 sees 1 and 2; 2 sees 2; 4 nothing.
  for (const auto& [point, keyframe, i] :
       {std::array{0, 3, 0}, std::array{0, 3, 2}, std::array{1, 3, 1}, std::array{2, 3, 3}, std::array{0, 0, 0},
        std::array{0, 0, 3}, std::array{1, 1, 0}, std::array{2, 1, 1}, std::array{2, 2, 0}})
    CHECK(turbomap::observe(map, p[static_cast<std::size_t>(point)], k[static_cast<std::size_t>(keyframe)],
                            static_cast<std::size_t>(i)));
  turbomap::covisibility<Map> covisibility;
  const auto of = [&](std::size_t query, int least, std::size_t limit = turbomap::no_limit) {
    pairs all;
    for (const auto& c : covisibility(map, k[query], least, limit))
      all.push_back({traits::id(map, c.keyframe), c.shared_points});
    return all;
  };
  CHECK(of(3, 1) == pairs{{1, 2}, {0, 1}, {2, 1}});
  CHECK(of(3, 0) == pairs{{1, 2}, {0, 1}, {2, 1}});
  CHECK(of(3, 2) == pairs{{1, 2}});
  CHECK(of(3, 3) == pairs{{1, 2}});  // nobody shares so many: the best one is left
  CHECK(of(3, 1, 2) == pairs{{1, 2}, {0, 1}});
  CHECK(of(3, 1, 9) == pairs{{1, 2}, {0, 1}, {2, 1}});
  CHECK(of(3, 1, 0).empty());
  CHECK(of(0, 1) == pairs{{3, 1}});
  CHECK(of(2, 1) == pairs{{1, 1}, {3, 1}});
  CHECK(of(2, 15) == pairs{{1, 1}});
  CHECK(of(4, 1).empty());
  turbomap::erase_keyframe(map, k[1], 0);
  CHECK(of(3, 1) == pairs{{0, 1}, {2, 1}});
  CHECK(of(3, 1) == pairs{{0, 1}, {2, 1}});  // nothing is left of earlier calls
}

TEST_CASE_TEMPLATE("of several keyframes: as of one after the other", Map, flat_map, pointer_map) {
  using traits = turbomap::map_traits<Map>;
  turbomap::covisibility<Map> one, all;
  for (std::uint32_t seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    Map map;
    std::vector<turbomap::keypoint> rig;
    for (int i = 0; i < 40; ++i) rig.push_back(make_keypoint(0, i % 2));
    turbomap::list_of<typename traits::keyframe> keyframes;
    std::vector<typename traits::point> points;
    for (int i = 0; i < 50; ++i) keyframes.push_back(insert_keyframe(map, rig, i, typename traits::keyframe{}));
    for (int i = 0; i < 100; ++i) points.push_back(traits::add_point(map, {}, keyframes[0]));
    for (int n = 0; n < 1600; ++n) {
      const std::size_t k = random() % 45;  // the last five see nothing
      turbomap::observe(map, points[(2 * k + random() % 30) % 100], keyframes[k], random() % 40);
    }
    turbomap::erase_keyframe(map, keyframes[7], 0);
    turbomap::erase_point(map, points[20]);
    const auto accept = [&](const typename traits::keyframe& k) {
      return seed % 2 == 0 || traits::id(map, k) % 3 != 0;
    };
    for (const std::size_t queries : {0U, 1U, 2U, 15U, 16U, 17U, 32U, 33U, 49U})
      for (const std::size_t limit : {std::size_t{0}, std::size_t{5}, turbomap::no_limit}) {
        turbomap::list_of<typename traits::keyframe> list;
        for (std::size_t i = 0; list.size() < queries; ++i)
          if (i != 7) list.push_back(keyframes[i]);
        const int least = static_cast<int>(random() % 6);
        std::size_t at = 0;
        all.of_each(map, list, least, limit, accept, [&](const auto& found) {
          const auto& expected = one(map, list[at++], least, limit, accept);
          REQUIRE(found.size() == expected.size());
          for (std::size_t i = 0; i < found.size(); ++i) {
            CHECK(found[i].keyframe == expected[i].keyframe);
            CHECK(found[i].shared_points == expected[i].shared_points);
          }
        });
        CHECK(at == queries);
      }
  }
}

TEST_CASE("an observer that is no keyframe is passed over: its name is not asked for anything") {
  pointer_map map;
  using traits = turbomap::map_traits<pointer_map>;
  turbomap::list_of<pointer_keyframe*> k;
  for (int i = 0; i < 2; ++i) k.push_back(insert_keyframe(map, {make_keypoint(0)}, i, nullptr));
  auto* const p = traits::add_point(map, {}, k[0]);
  for (auto* const observer : k) REQUIRE(turbomap::observe(map, p, observer, 0));
  p->observations[nullptr].push_back(3);
  turbomap::covisibility<pointer_map> covisibility;
  const auto check = [&](const auto& found, auto* expected) {
    REQUIRE(found.size() == 1);
    CHECK(found[0].keyframe == expected);
    CHECK(found[0].shared_points == 1);
  };
  check(covisibility(map, k[0], 1), k[1]);
  std::size_t at = 2;
  covisibility.of_each(map, k, 1, turbomap::no_limit, turbomap::every_keyframe(),
                       [&](const auto& found) { check(found, k[--at]); });
  CHECK(at == 0);
}

TEST_CASE("a keyframe without keypoints has no neighbours") {
  flat_map map;
  const auto k = map.add_keyframe({}, {});
  turbomap::covisibility<flat_map> covisibility;
  CHECK(covisibility(map, k, 1).empty());
}

}  // namespace
