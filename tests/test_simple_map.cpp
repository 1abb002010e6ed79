// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Slots and observations agree, whatever is asked of the map; covisibility equals a count of pairs.

#include <turbomap/map/simple_map.hpp>

#include <algorithm>
#include <array>
#include <iterator>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

namespace {

using turbomap::simple_map;
constexpr std::int32_t none = simple_map::none;

/// Two cameras: the first half of the keypoints is of the left one.
struct rig_of {
  std::int32_t left;
  bool operator()(std::int32_t a, std::int32_t b) const { return (a < left) == (b < left); }
};

/// Every observation has its slot and every slot its observation.
bool consistent(const simple_map& map) {
  std::size_t filled = 0, seen = 0;
  for (std::size_t k = 0; k < map.keyframe_count(); ++k)
    for (const std::int32_t p : map.slots(static_cast<std::int32_t>(k))) filled += p != none ? 1 : 0;
  for (std::size_t p = 0; p < map.point_count(); ++p)
    for (const auto& o : map.observations(static_cast<std::int32_t>(p))) {
      if (map.point_at(o.keyframe, o.keypoint) != static_cast<std::int32_t>(p)) return false;
      ++seen;
    }
  return filled == seen;
}

TEST_CASE("what was put in comes out") {
  simple_map map;
  turbomap::rigid_transform<double> T;
  T.tx = 4;
  CHECK(map.add_keyframe(3, {}) == 0);
  CHECK(map.add_keyframe(0, T) == 1);
  CHECK(map.add_point({1, 2, 3}) == 0);
  CHECK(map.keyframe_count() == 2);
  CHECK(map.point_count() == 1);
  CHECK(map.T_cw(1).tx == 4);
  CHECK(map.position(0).z == 3);
  CHECK(map.slots(0) == std::vector<std::int32_t>(3, none));
  CHECK(map.slots(1).empty());
  CHECK(map.observations(0).empty());
  std::vector<std::uint8_t> mask{9, 9, 9, 9};
  CHECK(map.observe(0, 0, 1));
  map.has_point(0, mask);
  CHECK(mask == std::vector<std::uint8_t>{0, 1, 0});
  map.has_point(1, mask);
  CHECK(mask.empty());
}

TEST_CASE("a slot holds one point, and a camera sees a point once") {
  simple_map map;
  map.add_keyframe(4, {}), map.add_keyframe(4, {});
  map.add_point({}), map.add_point({});
  const rig_of cameras{2};
  CHECK(map.observe(0, 0, 1, cameras));
  CHECK_FALSE(map.observe(1, 0, 1, cameras));  // the slot is taken
  CHECK_FALSE(map.observe(0, 0, 1, cameras));
  CHECK_FALSE(map.observe(0, 0, 0, cameras));  // seen by this camera already
  CHECK_FALSE(map.observe(0, 0, 2));           // one camera a keyframe
  CHECK(map.observe(0, 0, 2, cameras));        // the other camera
  CHECK_FALSE(map.observe(0, 0, 3, cameras));
  CHECK(map.observe(0, 1, 3, cameras));
  CHECK(map.observe(1, 0, 0));
  CHECK(map.slots(0) == std::vector<std::int32_t>{1, 0, 0, none});
  CHECK(map.observations(0).size() == 3);
  CHECK(consistent(map));
}

TEST_CASE("indices out of range change nothing") {
  simple_map map;
  map.add_keyframe(2, {});
  map.add_point({});
  CHECK_THROWS_WITH_AS(map.add_keyframe(-1, {}), "turbomap: keypoints = -1: must not be negative",
                       std::invalid_argument);
  CHECK(map.keyframe_count() == 1);
  for (const auto& [point, keyframe, keypoint] : {std::array{-1, 0, 0}, std::array{1, 0, 0}, std::array{0, -1, 0},
                                                  std::array{0, 1, 0}, std::array{0, 0, -1}, std::array{0, 0, 2}})
    CHECK_THROWS_AS(map.observe(point, keyframe, keypoint), std::invalid_argument);
  CHECK_THROWS_AS(map.point_at(0, 2), std::invalid_argument);
  CHECK_THROWS_AS(map.point_at(1, 0), std::invalid_argument);
  CHECK(map.slots(0) == std::vector<std::int32_t>{none, none});
  CHECK(map.observations(0).empty());
}

TEST_CASE("covisible keyframes: most shared first, equal ones by index, two views of a rig are one") {
  simple_map map;
  for (int k = 0; k < 4; ++k) map.add_keyframe(4, {});
  for (int p = 0; p < 3; ++p) map.add_point({});
  const rig_of cameras{2};
  // Keyframe 3 sees points 0, 1, 2; 0 sees 0 twice; 1 sees 1 and 2; 2 sees 2.
  for (const auto& [p, k, i] :
       {std::array{0, 3, 0}, std::array{0, 3, 2}, std::array{1, 3, 1}, std::array{2, 3, 3}, std::array{0, 0, 0},
        std::array{0, 0, 3}, std::array{1, 1, 0}, std::array{2, 1, 1}, std::array{2, 2, 0}})
    CHECK(map.observe(p, k, i, cameras));
  const auto of = [&map](std::int32_t k) {
    std::vector<std::pair<int, int>> all;
    for (const auto& c : map.covisible(k)) all.push_back({c.keyframe, c.shared_points});
    return all;
  };
  using pairs = std::vector<std::pair<int, int>>;
  CHECK(of(3) == pairs{{1, 2}, {0, 1}, {2, 1}});
  CHECK(of(0) == pairs{{3, 1}});
  CHECK(of(2) == pairs{{1, 1}, {3, 1}});
  simple_map lonely;
  lonely.add_keyframe(1, {});
  CHECK(lonely.covisible(0).empty());
}

TEST_CASE("random maps against sets") {
  std::mt19937 random(9);
  for (int round = 0; round < 20; ++round) {
    simple_map map;
    const int keyframes = 6, keypoints = 30, points = 25;
    for (int k = 0; k < keyframes; ++k) map.add_keyframe(keypoints, {});
    for (int p = 0; p < points; ++p) map.add_point({});
    std::vector<std::set<int>> seen(keyframes);
    int made = 0;
    for (int i = 0; i < 400; ++i) {
      const int p = static_cast<int>(random() % points), k = static_cast<int>(random() % keyframes);
      if (!map.observe(p, k, static_cast<int>(random() % keypoints), rig_of{15})) continue;
      seen[static_cast<std::size_t>(k)].insert(p);
      ++made;
    }
    CHECK(made > 100);
    CHECK(consistent(map));
    for (int k = 0; k < keyframes; ++k) {
      const auto found = map.covisible(k);
      CHECK(found.size() <= keyframes - 1);
      for (std::size_t i = 0; i < found.size(); ++i) {
        std::vector<int> both;
        const auto &a = seen[static_cast<std::size_t>(k)], &b = seen[static_cast<std::size_t>(found[i].keyframe)];
        std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
        CHECK(found[i].shared_points == static_cast<int>(both.size()));
        if (i > 0) CHECK(found[i - 1].shared_points >= found[i].shared_points);
      }
    }
  }
}

}  // namespace
