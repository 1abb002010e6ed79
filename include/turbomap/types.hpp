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
  T x;  ///< the first
  T y;  ///< the second
};

/// Three numbers, e.g. a point in metres.
template <class T>
struct vec3 {
  T x;  ///< the first
  T y;  ///< the second
  T z;  ///< the third
};

/// A 3x3 matrix, row-major.
template <class T>
struct mat3 {
  T m[9];  ///< row after row
  /// An element. Neither index is checked.
  TURBOMAP_HD constexpr T& operator()(int row, int column) { return m[3 * row + column]; }
  /// The same, to read.
  TURBOMAP_HD constexpr const T& operator()(int row, int column) const { return m[3 * row + column]; }
};

/// The derivative of a pixel by a point: 2x3, row-major.
template <class T>
struct mat23 {
  T m[6];  ///< row after row
  /// An element. Neither index is checked.
  TURBOMAP_HD constexpr T& operator()(int row, int column) { return m[3 * row + column]; }
  /// The same, to read.
  TURBOMAP_HD constexpr const T& operator()(int row, int column) const { return m[3 * row + column]; }
};

/// A rigid transform as quaternion and translation: `T_ab` maps x_b to x_a = R(q) x_b + t. A keyframe's pose is `T_cw`
/// (world to camera, or to the body of a rig). Where the squared length of the quaternion is off by no more than 1e-6, it is
/// used as stored, by the usual formula for unit ones; else it is scaled to unit length first.
template <class T>
struct rigid_transform {
  T qx = 0;  ///< quaternion, of i
  T qy = 0;  ///< quaternion, of j
  T qz = 0;  ///< quaternion, of k
  T qw = 1;  ///< quaternion, scalar part
  T tx = 0;  ///< translation, m
  T ty = 0;  ///< translation, m
  T tz = 0;  ///< translation, m
};

/// How well the position of a map point is known: its covariance in the world frame, m^2, the lower half of a symmetric
/// matrix. All zero: exact.
struct point_covariance {
  float xx = 0;  ///< variance of x
  float yx = 0;  ///< covariance of y and x
  float yy = 0;  ///< variance of y
  float zx = 0;  ///< covariance of z and x
  float zy = 0;  ///< covariance of z and y
  float zz = 0;  ///< variance of z
};

/// One keypoint as tracking hands it over.
struct keypoint {
  float x = 0;                     ///< px to the right: undistorted (pinhole) or raw (any other camera model)
  float y = 0;                     ///< px down, likewise
  float angle = 0;                 ///< orientation in degrees, [0, 360)
  float u_right = -1;              ///< column in the rectified right image, px; < 0: none
  float depth = -1;                ///< m; < 0: unknown
  std::uint32_t group = no_group;  ///< visual word group; keypoints of one group are compared in grouped search
  std::uint8_t octave = 0;         ///< pyramid level, 0 = finest
  std::uint8_t camera = 0;         ///< which camera of the rig saw it

  /// Of a keypoint that is in no group.
  static constexpr std::uint32_t no_group = 0xFFFFFFFFu;
};

/// The image pyramid: level o is scaled by scale_factor^o. Standard deviation of a keypoint at octave o is
/// scale_factor^o pixels [ORB-SLAM3].
struct pyramid {
  float scale_factor = 1.2F;  ///< from a level to the next coarser one; above 1 [ORB-SLAM3]
  int levels = 8;             ///< octaves are below it
};

/// Rectangle of pixels that keypoints can lie in, [min, max).
struct image_bounds {
  float min_x = 0;  ///< px, the first column
  float min_y = 0;  ///< px, the first row
  float max_x = 0;  ///< px, behind the last column
  float max_y = 0;  ///< px, behind the last row
};

static_assert(std::is_trivially_copyable_v<keypoint> && sizeof(keypoint) == 28);
static_assert(std::is_trivially_copyable_v<point_covariance> && sizeof(point_covariance) == 24);
static_assert(std::is_trivially_copyable_v<rigid_transform<float>> && sizeof(rigid_transform<float>) == 28);

}  // namespace turbomap
