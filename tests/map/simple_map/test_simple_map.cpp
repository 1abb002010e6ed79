// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A simple_map by itself: what is put in comes out, names are checked, places are used again under other names. Edits
/// are tested in test_map_edit.cpp and test_map_properties.cpp.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <stdexcept>
#include <vector>

#include "scenes/lying_map.hpp"
#include "scenes/map_scene.hpp"
#include "support/counted_new.hpp"

namespace {

using namespace turbomap_test;
using traits = turbomap::map_traits<flat_map>;
using turbomap::map_keyframe_id;
using turbomap::map_point_id;

TEST_CASE("what was put in comes out") {
  flat_map map;
  CHECK(map.levels() == 8);
  CHECK(map.keyframe_count() == 0);
  CHECK(map.point_count() == 0);
  turbomap::rigid_transform<double> T;
  T.tx = 4;
  const std::vector<turbomap::keypoint> keypoints{make_keypoint(0), make_keypoint(7, 1, 5)};
  const auto a = map.add_keyframe(keypoints, T, 1.5);
  const auto b = map.add_keyframe({}, {});
  const auto p = map.add_point({1, 2, 3}, a);
  CHECK(map.keyframe_count() == 2);
  CHECK(map.point_count() == 1);
  CHECK(map.alive(a));
  CHECK(map.alive(p));
  CHECK(map.T_cw(a).tx == 4);
  CHECK(map.position(p).z == 3);
  CHECK(map.keypoints(a).size() == 2);
  CHECK(map.keypoints(a)[1].u_right == 5);
  CHECK(map.keypoints(b).empty());
  CHECK(map.observations(p).empty());
  CHECK(map.point_at(a, 1) == map_point_id{});
  CHECK(traits::id(map, a) == 0);
  CHECK(traits::id(map, b) == 1);
  CHECK(traits::id(map, p) == 0);
  CHECK(traits::time(map, a) == 1.5);
  CHECK(traits::reference(map, p) == a);
  CHECK(traits::replacement(map, p) == map_point_id{});
  CHECK_FALSE(traits::may_erase(map, a));  // the first
  CHECK(traits::may_erase(map, b));
  CHECK(traits::octave_counts(map, p).size() == 8);
  map.set_pose(b, T);
  CHECK(traits::pose(map, b).tx == 4);
  traits::set_position(map, p, {7, 8, 9});
  CHECK(map.position(p).x == 7);
  std::vector<std::uint8_t> descriptor(32);
  for (std::size_t i = 0; i < 32; ++i) descriptor[i] = static_cast<std::uint8_t>(3 * i);
  const auto q = map.add_point({});
  traits::set_appearance(map, p, {1, 0, 0}, 2, 3, descriptor.data());
  CHECK(traits::normal(map, p).x == 1);
  CHECK(traits::min_distance(map, p) == 2);
  CHECK(traits::max_distance(map, p) == 3);
  CHECK(traits::descriptor_data(map, p)[31] == 93);
  CHECK(traits::descriptor_data(map, q)[0] == 0);
  CHECK(traits::max_distance(map, q) == 0);
  CHECK(traits::reference(map, q) == map_keyframe_id{});
  CHECK(turbomap::observe(map, p, a, 1));
  CHECK(map.point_at(a, 1) == p);
  CHECK(map.observations(p)[0].keypoint == 1);
  CHECK(map.keyframe_at(map.observations(p)[0].keyframe) == a);
}

TEST_CASE("a pose and a position of the map itself may be given") {
  flat_map map;
  turbomap::rigid_transform<double> T;
  T.tx = 4;
  auto k = map.add_keyframe({}, T);
  auto p = map.add_point({1, 2, 3}, k);
  for (int n = 0; n < 200; ++n) {  // its lists move several times
    k = map.add_keyframe({}, map.T_cw(k), 0, k);
    p = map.add_point(map.position(p), k);
    REQUIRE(map.T_cw(k).tx == 4);
    REQUIRE(map.position(p).z == 3);
  }
}

TEST_CASE("bad input is refused, and changes nothing") {
  CHECK_THROWS_WITH_AS(flat_map(0), "turbomap: levels = 0: must be in [1, 256]: octaves are bytes",
                       std::invalid_argument);
  CHECK_THROWS_AS(flat_map(257), std::invalid_argument);
  flat_map(1), flat_map(256);
  flat_map map(3);
  const std::vector<turbomap::keypoint> good{make_keypoint(2)}, bad{make_keypoint(2), make_keypoint(3)};
  const auto k = map.add_keyframe(good, {});
  const auto p = map.add_point({1, 2, 3}, k);
  const auto before = everything(map);
  CHECK_THROWS_WITH_AS(map.add_keyframe(bad, {}),
                       "turbomap: keypoints[].octave = 3: is not a level of the map's pyramid", std::invalid_argument);
  for (const map_keyframe_id unknown :
       {map_keyframe_id{}, map_keyframe_id{k.index + 1, k.generation}, map_keyframe_id{k.index, k.generation + 1}}) {
    CHECK_FALSE(map.alive(unknown));
    CHECK_THROWS_AS(map.T_cw(unknown), std::invalid_argument);
    CHECK_THROWS_AS(map.set_pose(unknown, {}), std::invalid_argument);
    CHECK_THROWS_AS(map.keypoints(unknown), std::invalid_argument);
    CHECK_THROWS_AS(map.point_at(unknown, 0), std::invalid_argument);
    if (unknown == map_keyframe_id{}) continue;
    CHECK_THROWS_AS(map.add_keyframe(good, {}, 0, unknown), std::invalid_argument);
    CHECK_THROWS_AS(map.add_point({}, unknown), std::invalid_argument);
  }
  for (const map_point_id unknown :
       {map_point_id{}, map_point_id{p.index + 1, p.generation}, map_point_id{p.index, p.generation + 1}}) {
    CHECK_FALSE(map.alive(unknown));
    CHECK_THROWS_AS(map.position(unknown), std::invalid_argument);
    CHECK_THROWS_AS(map.observations(unknown), std::invalid_argument);
    CHECK_THROWS_AS(map.seen_in_tracking(unknown, 1, 1), std::invalid_argument);
  }
  CHECK_THROWS_WITH_AS(map.point_at(k, 1), "turbomap: keypoint = 1: is not a keypoint of the keyframe",
                       std::invalid_argument);
  CHECK(everything(map) == before);
  CHECK(map.alive(p));
}

TEST_CASE("places are used again, under other names") {
  flat_map map;
  const std::vector<turbomap::keypoint> keypoints{make_keypoint(1)};
  const auto a = map.add_keyframe(keypoints, {});
  const auto p = map.add_point({1, 1, 1}, a);
  turbomap::observe(map, p, a, 0);
  turbomap::erase_point(map, p);
  CHECK_FALSE(map.alive(p));
  CHECK(map.point_count() == 0);
  CHECK(map.point_at(a, 0) == map_point_id{});
  const auto q = map.add_point({2, 2, 2});
  CHECK(q.index == p.index);
  CHECK(q != p);
  CHECK(map.alive(q));
  CHECK_FALSE(map.alive(p));
  CHECK(traits::id(map, q) == 1);  // ids are never used again
  CHECK(map.observations(q).empty());
  CHECK(traits::octave_counts(map, q)[1] == 0);
  CHECK(turbomap::resolve(map, p) == map_point_id{});
  turbomap::observe(map, q, a, 0);
  const auto kept = map.add_keyframe(keypoints, {});
  turbomap::erase_keyframe(map, a, 0);
  CHECK_FALSE(map.alive(a));
  CHECK_FALSE(map.alive(q));
  CHECK(map.keyframe_count() == 1);
  turbomap::erase_keyframe(map, kept, 0);
  CHECK(traits::id(map, a) == 0);  // for mapper.remove()
  CHECK(traits::id(map, kept) == 1);
  const auto b = map.add_keyframe(keypoints, {});
  CHECK(b.index == kept.index);
  CHECK(b != kept);
  CHECK(traits::id(map, b) == 2);
  CHECK(traits::id(map, kept) > 2);  // not that of b, nor of any other
  CHECK(traits::id(map, a) == 0);
  const auto c = map.add_keyframe(keypoints, {});
  CHECK(c.index == a.index);
  CHECK(traits::id(map, a) == traits::id(map, kept));
  CHECK(map.point_at(b, 0) == map_point_id{});
  CHECK_THROWS_AS(map.point_at(a, 0), std::invalid_argument);
}

TEST_CASE("what a merged point became is known until it is forgotten") {
  flat_map map;
  std::vector<std::pair<map_keyframe_id, std::size_t>> scratch;
  const auto a = map.add_point({}), b = map.add_point({}), c = map.add_point({});
  map.seen_in_tracking(a, 10, 1), map.seen_in_tracking(b, 4, 3);
  CHECK(traits::found_ratio(map, a) == 0.1F);
  CHECK(traits::found_ratio(map, c) == 1);
  CHECK(turbomap::merge_points(map, a, b, turbomap::merge_rule::refuse, scratch));
  CHECK(traits::found_ratio(map, b) == 4.F / 14);
  CHECK(turbomap::merge_points(map, b, c, turbomap::merge_rule::refuse, scratch));
  CHECK(map.point_count() == 1);
  CHECK(traits::replacement(map, a) == b);
  CHECK(turbomap::resolve(map, a) == c);
  const auto d = map.add_point({});  // not in the place of a or b
  CHECK(d.index == 3);
  map.forget_replacements(), map.forget_replacements();
  CHECK(turbomap::resolve(map, a) == map_point_id{});
  CHECK(turbomap::resolve(map, b) == map_point_id{});
  CHECK(turbomap::resolve(map, c) == c);
  const auto e = map.add_point({}), f = map.add_point({}), g = map.add_point({});
  CHECK(e.index + f.index == 1);
  CHECK(g.index == 4);
  CHECK(map.point_count() == 5);
}

TEST_CASE("the chain in time holds through insertion and removal") {
  flat_map map;
  const auto a = map.add_keyframe({}, {}, 0), c = map.add_keyframe({}, {}, 2, a);
  const auto b = map.add_keyframe({}, {}, 1, a);  // between
  const auto d = map.add_keyframe({}, {}, 3, c);
  const auto chain = [&map](map_keyframe_id k) {
    std::vector<double> times;
    map_keyframe_id last{};
    for (; k != map_keyframe_id{}; last = k, k = traits::next(map, k)) {
      CHECK(traits::previous(map, k) == last);
      times.push_back(traits::time(map, k));
    }
    return times;
  };
  CHECK(chain(a) == std::vector<double>{0, 1, 2, 3});
  turbomap::erase_keyframe(map, c);
  CHECK(chain(a) == std::vector<double>{0, 1, 3});
  turbomap::erase_keyframe(map, a);
  CHECK(chain(b) == std::vector<double>{1, 3});
  turbomap::erase_keyframe(map, d);
  CHECK(chain(b) == std::vector<double>{1});
  const auto e = map.add_keyframe({}, {}, 9);  // a chain of its own
  CHECK(traits::previous(map, e) == map_keyframe_id{});
  CHECK(chain(b) == std::vector<double>{1});
}

TEST_CASE("memory grows by doubling: few allocations for many points and keyframes") {
  flat_map map;
  const long before = allocations;
  for (int i = 0; i < 20000; ++i) map.add_point({});
  CHECK(allocations - before < 400);
  const long middle = allocations;
  for (int i = 0; i < 2000; ++i) map.add_keyframe({}, {});
  CHECK(allocations - middle < 200);
}

TEST_CASE("out of memory leaves the map as it was") {
  const std::vector<turbomap::keypoint> keypoints(5);
  flat_map map;
  for (int i = 0; i < 8; ++i) map.add_point({}), map.add_keyframe(keypoints, {});  // everything is full
  int refused = 0;
  for (const bool point : {true, false}) {
    const auto before = everything(map);
    for (long until = 0;; ++until) {
      allocations_left = until;
      bool done = true;
      try {
        point ? static_cast<void>(map.add_point({})) : static_cast<void>(map.add_keyframe(keypoints, {}));
      } catch (const std::bad_alloc&) {
        done = false;
      }
      allocations_left = no_limit;
      if (done) break;
      ++refused;
      CHECK(everything(map) == before);
      CHECK(map.point_count() == (point ? 8 : 9));
      CHECK(map.keyframe_count() == 8);
    }
  }
  CHECK(refused > 4);
  CHECK(map.point_count() == 9);
  CHECK(map.keyframe_count() == 9);
  const auto p = map.add_point({});
  turbomap::erase_point(map, p);
  CHECK(map.point_count() == 9);
}

using inertial_map = turbomap::simple_inertial_map<turbomap::binary_descriptor<256>, turbomap::pinhole<float>>;

TEST_CASE("what is set of a keyframe may be what the map has of another one") {
  inertial_map map;
  const std::vector<turbomap::keypoint> keypoints(1);
  const auto known = map.add_keyframe(keypoints, {});
  map.set_velocity(known, {1, 2, 3}), map.set_bias(known, {{4, 5, 6}, {7, 8, 9}});
  turbomap::preintegration<double> motion;
  motion.dt = 0.5;
  map.set_motion(known, motion);
  for (int i = 0; i < 40; ++i) {  // of keyframes that have no room for it: the list grows when it is set
    const auto k = static_cast<inertial_map::simple_map&>(map).add_keyframe(keypoints, {});
    if (i % 3 == 0) map.set_velocity(k, map.velocity(known));
    if (i % 3 == 1) map.set_bias(k, map.bias(known));
    if (i % 3 == 2) map.set_motion(k, *map.motion(known));
    CHECK(map.velocity(k).z == (i % 3 == 0 ? 3 : 0));
    CHECK(map.bias(k).acceleration.z == (i % 3 == 1 ? 9 : 0));
    CHECK((map.motion(k) != nullptr) == (i % 3 == 2));
  }
}

TEST_CASE("options with which samples could not be integrated again are refused") {
  inertial_map map;
  turbomap::preintegration_options bad;
  bad.max_gyro_bias_change = std::numeric_limits<double>::quiet_NaN();
  turbomap::rigid_transform<double> T_bc;
  T_bc.tx = 0.1;
  CHECK_THROWS_WITH_AS(map.set_imu(T_bc, bad), doctest::Contains("max_gyro_bias_change"), std::invalid_argument);
  CHECK(map.T_bc().tx == 0);
  bad = {};
  bad.noise.gyro = -1;
  CHECK_THROWS_WITH_AS((inertial_map(8, {}, bad)), doctest::Contains("noise.gyro"), std::invalid_argument);
}

}  // namespace
