// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-before-after's comparison of two maps sees each thing that differs, and numbers that are none.

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <turbomap/camera/pinhole.hpp>

#include "before_after/map_difference.hpp"

namespace {

using map_type = turbomap_program::objects_map<turbomap::pinhole<float>>;

/// One keyframe of two keypoints and a point that the first of them shows.
struct small_map {
  map_type map;
  turbomap_program::keyframe_ptr keyframe;
  turbomap_program::point_ptr point;
  std::array<std::uint8_t, 32> descriptor{};

  small_map() {
    const std::vector<turbomap::keypoint> keypoints(2);
    keyframe = map.add_keyframe(keypoints, turbomap::rigid_transform<double>{});
    point = map.add_point({1, 2, 3}, keyframe);
    observe(0);
    look(1, 2);
  }
  void observe(std::size_t keypoint) {
    point->add_observation(keyframe, keypoint);
    keyframe->set_point(keypoint, point);
  }
  void look(float normal_z, float max_distance) {
    point->set_appearance({{0, 0, normal_z}, 0, max_distance}, descriptor.data());
  }
};

TEST_CASE("two maps are compared in all that they hold") {
  const small_map a;
  small_map b;
  const auto differ = [&] { return turbomap_before_after::compare(a.map, b.map); };
  CHECK(differ().equal());  // with ranges that begin at 0
  SUBCASE("keyframes") {
    b.map.add_keyframe({}, turbomap::rigid_transform<double>{});
    CHECK(differ().keyframes == 1);
  }
  SUBCASE("points") {
    b.map.add_point({0, 0, 0});
    CHECK(differ().points == 1);
    CHECK(turbomap_before_after::compare(b.map, a.map).points == 1);
  }
  SUBCASE("observations") {
    b.observe(1);
    CHECK(differ().observations == 1);
  }
  SUBCASE("descriptors") {
    b.descriptor[31] = 1, b.look(1, 2);
    CHECK(differ().descriptors == 1);
  }
  SUBCASE("positions") {
    b.point->set_position({1, 2, 3.5});
    CHECK(differ().position_m == 0.5);
  }
  SUBCASE("normals and ranges") {
    b.look(0.5F, 3);
    CHECK(differ().appearance == 0.5);
  }
  SUBCASE("a position that is no number") {
    b.point->set_position({std::numeric_limits<double>::quiet_NaN(), 2, 3});
    CHECK(differ().position_m == HUGE_VAL);
  }
  SUBCASE("a normal that is no number") {
    b.look(std::numeric_limits<float>::quiet_NaN(), 2);
    CHECK(differ().appearance == HUGE_VAL);
  }
  SUBCASE("a range that is no number") {
    b.look(1, std::numeric_limits<float>::quiet_NaN());
    CHECK(differ().appearance == HUGE_VAL);
  }
  CHECK(!differ().equal());
}

}  // namespace
