// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A bundle adjustment of reprojections as plain arrays, whatever file it came from. The rig is given beside it.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../types.hpp"

namespace turbomap {

/// Frames, landmarks, and which frame saw which landmark where. Every index is inside its array, every number that
/// means something finite.
struct reprojection_data {
  std::vector<rigid_transform<double>> T_cw;  ///< poses of the frames (of the rig's body)
  std::vector<std::uint8_t> fixed;            ///< one per frame; 1: it does not move
  std::vector<vec3<double>> points;           ///< landmarks, world, m
  // One row per observation.
  std::vector<std::int32_t> frame;     ///< index of the frame
  std::vector<std::int32_t> landmark;  ///< index of the landmark
  std::vector<std::uint8_t> camera;    ///< of the rig; empty: all are the first
  std::vector<vec3<double>> pixel;     ///< u, v, u_right in px
  std::vector<std::uint8_t> stereo;  ///< 1: u_right counts (it may be left of the image, negative); 0: it means nothing
  std::vector<double> information;   ///< 1 / sigma^2, px^-2

  /// Number of frames.
  std::size_t frame_count() const { return T_cw.size(); }
  /// Number of observations.
  std::size_t observation_count() const { return frame.size(); }
};

}  // namespace turbomap
