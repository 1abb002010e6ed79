// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where a keypoint of a pyramid's level lies in the full image. Extractors multiply its pixel in the level by scale_factor^o.
/// But an image that is resized keeps its corners, not the centre of its first pixel, and its size is rounded: the product is
/// off by half a pixel of the level less half a pixel of the full image, 1.3 px at level 7, and by a little that grows
/// towards the far corner. The offset differs from level to level, so it does not cancel between views from other distances.

#include <cmath>

#include "../error.hpp"
#include "../types.hpp"

namespace turbomap {

namespace plain_detail {

/// Pixels along a side of the level that is smaller by s, as extractors make it, OpenCV's ORB among them: computed in float, and
/// halves go to the even number. Of 1241 px half are 620, not 621.
inline double side_of_level(int side, double s) {
  const float inverse = 1 / static_cast<float>(s);
  return std::nearbyint(static_cast<float>(side) * inverse);
}

}  // namespace plain_detail

/// The keypoint with x, y, and u_right where it has one, moved to where they are in the full image:
/// (x / s^o + 1/2) w / w_o - 1/2, as pixels map in OpenCV's resize(): w the width (y: the height), and w_o that of the level, w / s^o
/// rounded as extractors do. The depth changes with the disparity. Octave 0 stays as it is.
/// For keypoints of an extractor that resizes the image for each level and multiplies by s^o, as ORB of OpenCV and of systems
/// that follow [ORB-SLAM]; before lens distortion is removed, as it is in pixels of the image that was resized.
/// \param width,height  of the full image, px   \param scale_factor  s, from a level to the next
/// \throws std::invalid_argument  a size or scale factor that is not positive, or a level of less than a pixel
inline keypoint in_full_image(keypoint k, int width, int height, float scale_factor) {
  require(width > 0, "width", width, "must be positive");
  require(height > 0, "height", height, "must be positive");
  require(scale_factor > 0, "scale_factor", scale_factor, "must be positive");
  const double s = std::pow(static_cast<double>(scale_factor), static_cast<double>(k.octave));
  const double columns = plain_detail::side_of_level(width, s), rows = plain_detail::side_of_level(height, s);
  require(columns >= 1 && rows >= 1, "octave", static_cast<int>(k.octave), "leaves nothing of the image");
  const auto move = [s](float x, double ratio) { return static_cast<float>((x / s + 0.5) * ratio - 0.5); };
  k.x = move(k.x, width / columns), k.y = move(k.y, height / rows);
  if (k.u_right >= 0) {
    k.u_right = move(k.u_right, width / columns);
    if (k.depth > 0) k.depth *= static_cast<float>(s * columns / width);
  }
  return k;
}

}  // namespace turbomap
