// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Corners that a detector finds in two octaves: which of the further keypoints the mapper makes points of, where the first
/// ones have points already.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;
using map_type = turbomap::simple_map<orb, camera>;

constexpr int corners = 30, bytes = 32;

/// Two keyframes side by side see corners on a wall, each at octave 0, where it has a point, and at another octave, where it has
/// none. How many points are made?
std::size_t points_made(int octave, const turbomap::local_mapper_options& options) {
  turbomap::context ctx;
  map_type map;
  turbomap::keyframe_store<orb, camera> store;
  const auto rig = turbomap::make_mono_rig(camera{400, 400, 320, 240});
  std::mt19937 random(7);
  std::vector<std::uint8_t> descriptors(2 * corners * bytes);
  for (auto& d : descriptors) d = static_cast<std::uint8_t>(random());
  std::vector<turbomap::map_point_id> points;
  turbomap::local_mapper mapper(ctx, map, store, options);
  turbomap::map_keyframe_id before;
  for (const double x : {0.0, 0.4}) {
    std::vector<turbomap::keypoint> keypoints(2 * corners);
    for (int i = 0; i < 2 * corners; ++i) {
      const int c = i % corners;
      auto& k = keypoints[static_cast<std::size_t>(i)];
      const double X = 0.5 * (c % 6 - 2.5) - x, Y = 0.5 * (c / 6 - 2);  // 4 m away
      k.x = static_cast<float>(320 + 100 * X), k.y = static_cast<float>(240 + 100 * Y);
      k.octave = static_cast<std::uint8_t>(i < corners ? 0 : octave);
    }
    turbomap::rigid_transform<double> T_cw;
    T_cw.tx = -x;
    const auto id = map.add_keyframe(keypoints, T_cw, x, before);
    for (int c = 0; c < corners; ++c) {
      if (x == 0) points.push_back(map.add_point({0.5 * (c % 6 - 2.5), 0.5 * (c / 6 - 2), 4}, id));
      turbomap::observe(map, points[static_cast<std::size_t>(c)], id, static_cast<std::size_t>(c));
    }
    mapper.insert(id, turbomap::keyframe_data<orb, camera>{
                          2 * corners, keypoints.data(), descriptors.data(), rig.cameras, 1, {0, 0, 640, 480}});
    before = id;
  }
  return mapper.process(before).points_created;
}

/// Search and creation only.
turbomap::local_mapper_options made_by_creation() {
  auto options = turbomap::local_mapper_options::monocular();
  for (const auto stage : {turbomap::mapping_stage::point_culling, turbomap::mapping_stage::fusion,
                           turbomap::mapping_stage::adjustment, turbomap::mapping_stage::keyframe_culling})
    options.enabled[stage] = false;
  return options;
}

}  // namespace

TEST_CASE("a corner's keypoints are two points where they are more than known_octaves apart") {
  auto options = made_by_creation();
  for (const int octave : {0, 1, 2, 3, 7}) CHECK(points_made(octave, options) == (octave <= 1 ? 0 : corners));
  options.creation.known_octaves = 255;
  for (const int octave : {1, 2, 7}) CHECK(points_made(octave, options) == 0);
  options.creation.known_octaves = 0;
  CHECK(points_made(0, options) == 0);
  CHECK(points_made(1, options) == corners);
}

TEST_CASE("balanced and accurate: keypoints of any octave count, and a corner has one point") {
  const auto options = made_by_creation();
  for (const auto& o : {options.balanced(), options.accurate()})
    for (const int octave : {1, 2, 7}) CHECK(points_made(octave, o) == 0);
}
