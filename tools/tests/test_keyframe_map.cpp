// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Maps in the .kfm format: what is read, and what is refused by name.

#include "evaluation/keyframe_map.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include "scenes/keyframe_map_bytes.hpp"
#include "support/files.hpp"

using namespace turbomap_test;
using turbomap::evaluation::read_keyframe_map;

TEST_CASE("a .kfm file is read") {
  const temporary_directory folder;
  write_bytes(folder / "map.kfm", keyframe_map_bytes());
  const auto map = read_keyframe_map(folder / "map.kfm");
  CHECK(map.width == 752);
  CHECK(map.camera.k1 == -0.28);
  REQUIRE(map.keyframes.size() == 1);
  const auto& k = map.keyframes[0];
  CHECK(k.pixels[0].y == 20.5F);
  CHECK(k.landmarks[0] == 0);
  CHECK(k.descriptors.size() == 4);
  CHECK(k.T_cw.qy == -0.6);
  REQUIRE(map.landmarks.size() == 1);
  CHECK(map.landmarks[0].good());
  CHECK(map.landmarks[0].position.z == 3);
}

TEST_CASE("a .kfm file with numbers that cannot be is refused by name") {
  namespace at = keyframe_map_at;
  const temporary_directory folder;
  const auto message = [&](std::size_t offset, auto value) {
    std::string bytes = keyframe_map_bytes();
    std::memcpy(&bytes[offset], &value, sizeof value);
    write_bytes(folder / "map.kfm", bytes);
    return bad_file_message([&] { read_keyframe_map(folder / "map.kfm"); });
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(has(message(at::intrinsics, nan), "intrinsics: not finite"));
  CHECK(has(message(at::pose, nan), "pose of keyframe 0: not finite"));
  CHECK(has(message(at::pose, 1.0), "pose of keyframe 0: no rotation"));
  CHECK(has(message(at::pixel, std::numeric_limits<float>::infinity()), "uv of keyframe 0: not finite"));
  CHECK(has(message(at::position, nan), "xyz of landmark 0: not finite"));
  CHECK(has(message(at::landmark, std::int32_t{1}), "landmark: index 1"));
  CHECK(has(message(at::width, std::uint32_t{0}), "header: an image of 0 pixels"));
  CHECK(has(message(at::width, ~std::uint32_t{0}), "header: an image of 4294967295 pixels"));
  CHECK(has(message(at::descriptor_bytes, ~std::uint32_t{0}), "header: descriptors of 4294967295 bytes"));
  // Sizes are held against the file before memory is asked for.
  CHECK(has(message(at::descriptor_bytes, std::uint32_t{60000}), "uv: the file is cut short"));
  CHECK(has(message(at::keypoints, std::uint32_t{30}), "uv: the file is cut short"));
  CHECK(has(message(at::keyframes, std::uint32_t{2}), "the file is cut short"));
}
