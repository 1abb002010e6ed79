// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random keyframes for tests of the map: rigs, octaves, stereo keypoints and depths in all mixtures.

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/types.hpp>

#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace turbomap_test {

using map_descriptor = turbomap::binary_descriptor<256>;
using map_camera = turbomap::pinhole<float>;
using flat_map = turbomap::simple_map<map_descriptor, map_camera>;

inline turbomap::keypoint make_keypoint(int octave, int camera = 0, float u_right = -1, float depth = -1) {
  turbomap::keypoint k;
  k.octave = static_cast<std::uint8_t>(octave);
  k.camera = static_cast<std::uint8_t>(camera);
  k.u_right = u_right;
  k.depth = depth;
  return k;
}

/// Keypoints of all cameras of a rig, by camera, in a small corner of the image: some are as near as noise. Some have
/// u_right, some a depth, a few are NaN there.
inline std::vector<turbomap::keypoint> random_keypoints(std::uint32_t seed, int cameras, int levels, int per_camera) {
  std::mt19937 random(seed);
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const auto stereo_share = random() % 4;  // of 3
  std::vector<turbomap::keypoint> all;
  for (int c = 0; c < cameras; ++c)
    for (int i = 0; i < per_camera; ++i) {
      auto k = make_keypoint(static_cast<int>(random() % static_cast<unsigned>(levels)), c);
      k.x = static_cast<float>(random() % 12), k.y = static_cast<float>(random() % 6);
      if (random() % 64 == 0) k.x = nan;
      if (random() % 3 < stereo_share) k.u_right = static_cast<float>(random() % 640), k.depth = 1 + k.u_right / 64;
      if (random() % 32 == 0) k.u_right = nan;
      if (random() % 32 == 0) k.depth = nan;
      all.push_back(k);
    }
  return all;
}

/// The same call for every map type of the tests. Ids ascend with each keyframe.
inline turbomap::map_keyframe_id insert_keyframe(flat_map& map, const std::vector<turbomap::keypoint>& keypoints,
                                                 double time_s, turbomap::map_keyframe_id previous) {
  return map.add_keyframe(keypoints, {}, time_s, previous);
}

}  // namespace turbomap_test
