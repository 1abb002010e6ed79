// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The plain data that every part of the library uses: small vectors, rigid transforms, keypoints, the scale pyramid.
/// There is no Eigen member: these structs are shared by files of several compilers and copied to devices, so their layout
/// must not depend on flags.

#include <cstdint>
#include <type_traits>

#include "config.hpp"

namespace turbomap {

/// Two numbers, e.g. a pixel (u right, v down).
template <class T>
struct vec2 {
  T x, y;
};

/// Three numbers, e.g. a point in metres.
template <class T>
struct vec3 {
  T x, y, z;
};

/// A 3x3 matrix, row-major.
template <class T>
struct mat3 {
  T m[9];
  TURBOMAP_HD constexpr T& operator()(int row, int column) { return m[3 * row + column]; }
  TURBOMAP_HD constexpr const T& operator()(int row, int column) const { return m[3 * row + column]; }
};

/// The derivative of a pixel by a point: 2x3, row-major.
template <class T>
struct mat23 {
  T m[6];
  TURBOMAP_HD constexpr T& operator()(int row, int column) { return m[3 * row + column]; }
  TURBOMAP_HD constexpr const T& operator()(int row, int column) const { return m[3 * row + column]; }
};

/// A rigid transform as quaternion and translation: `T_ab` maps x_b to x_a = R(q) x_b + t. A keyframe's pose is `T_cw`
/// (world to camera, or to the body of a rig). The quaternion is used as stored, by the usual formula for unit ones;
/// nothing normalises it.
template <class T>
struct rigid_transform {
  T qx = 0, qy = 0, qz = 0, qw = 1;
  T tx = 0, ty = 0, tz = 0;
};

/// How well the position of a map point is known: its covariance in the world frame, m^2, the lower half of a symmetric
/// matrix. All zero: exact.
struct point_covariance {
  float xx = 0, yx = 0, yy = 0, zx = 0, zy = 0, zz = 0;
};

/// One keypoint as tracking hands it over.
struct keypoint {
  float x = 0, y = 0;              ///< pixel: undistorted (pinhole) or raw (any other camera model)
  float angle = 0;                 ///< orientation in degrees, [0, 360)
  float u_right = -1;              ///< column in the rectified right image, px; < 0: none
  float depth = -1;                ///< m; < 0: unknown
  std::uint32_t group = no_group;  ///< visual word group; keypoints of one group are compared in grouped search
  std::uint8_t octave = 0;         ///< pyramid level, 0 = finest
  std::uint8_t camera = 0;         ///< which camera of the rig saw it

  static constexpr std::uint32_t no_group = 0xFFFFFFFFu;
};

/// The image pyramid: level o is scaled by scale_factor^o. Standard deviation of a keypoint at octave o is
/// scale_factor^o pixels [ORB-SLAM3].
struct pyramid {
  float scale_factor = 1.2F;
  int levels = 8;
};

/// Rectangle of pixels that keypoints can lie in, [min, max).
struct image_bounds {
  float min_x = 0, min_y = 0, max_x = 0, max_y = 0;
};

static_assert(std::is_trivially_copyable_v<keypoint> && sizeof(keypoint) == 28);
static_assert(std::is_trivially_copyable_v<point_covariance> && sizeof(point_covariance) == 24);
static_assert(std::is_trivially_copyable_v<rigid_transform<float>> && sizeof(rigid_transform<float>) == 28);

}  // namespace turbomap
