// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map in the .kfm format (tools/evaluation/keyframe_map.hpp) that tests damage: one keyframe, one pixel, one landmark.

#include <cstdint>
#include <cstring>
#include <string>

namespace turbomap_test {

/// Offsets of what tests change.
namespace keyframe_map_at {
inline constexpr std::size_t keyframes = 8, descriptor_bytes = 16, width = 20, intrinsics = 32, keypoints = 116,
                             pose = 120, pixel = 176, landmark = 184, position = 192;
}  // namespace keyframe_map_at

inline std::string keyframe_map_bytes() {
  std::string bytes = "KFM1";
  const auto put = [&bytes](auto value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  for (const std::uint32_t x : {1U, 1U, 1U, 4U, 752U, 480U, 0U}) put(x);
  for (const double x : {458.0, 457.0, 367.0, 248.0, -0.28, 0.07, 2e-4, 1e-5, 0.0}) put(x);
  put(std::uint64_t{1403715527912143104}), put(1U), put(1U);
  for (const double x : {0.0, 0.6, 0.0, 0.8, 1.0, 2.0, 3.0}) put(x);
  put(10.5F), put(20.5F), put(std::int32_t{0}), put(0x01020304U);
  for (const double x : {1.0, 2.0, 3.0}) put(x);
  put(2U), put(1U);
  return bytes;
}

}  // namespace turbomap_test
