// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What every search reads: the immutable part of a keyframe as plain pointers into the memory of the policy. The
/// keyframe store makes these; users with flat arrays make them themselves, without traits and without a copy.

#include <cstddef>
#include <cstdint>

#include "../camera/rig_camera.hpp"
#include "../config.hpp"
#include "../types.hpp"

namespace turbomap {

/// Indices below 65,536 take 16 bits, others 32: half the bytes for every keyframe a camera will ever produce, no limit.
struct index_list {
  const void* data = nullptr;  ///< of 16 or 32 bits each
  bool wide = false;           ///< 32 bits each instead of 16

  /// Index number i; not checked.
  TURBOMAP_HD std::uint32_t operator[](std::size_t i) const {
    return wide ? static_cast<const std::uint32_t*>(data)[i] : static_cast<const std::uint16_t*>(data)[i];
  }
};

/// A grid over one image: keypoints by cell, in CSR form. The cells of camera k of the rig are
/// [k * columns * rows, (k + 1) * columns * rows); cell (column, row) of a camera has index column * rows + row, and within a
/// cell keypoints ascend. A keypoint's cell is round((x - min_x) * inverse_width), halves away from zero, likewise in y;
/// keypoints outside the grid are in no cell.
struct cell_index_view {
  index_list offsets;        ///< cameras * columns * rows + 1
  index_list keypoints;      ///< cell after cell
  image_bounds bounds;       ///< of the image, px
  float inverse_width = 0;   ///< columns / (max_x - min_x)
  float inverse_height = 0;  ///< rows / (max_y - min_y)
  int columns = 0;           ///< 0: there is no grid
  int rows = 0;              ///< of cells
};

/// Keypoints by visual word group, in CSR form: group ids ascend, and so do the keypoints of a group. Keypoints without a
/// group are left out.
struct group_index_view {
  const std::uint32_t* ids = nullptr;  ///< group_count
  index_list offsets;                  ///< group_count + 1
  index_list keypoints;                ///< group after group
  int group_count = 0;                 ///< 0: there are no groups
};

/// The immutable part of one keyframe, N keypoints of all cameras of the rig in one numbering. Optional arrays may be null.
template <class Descriptor, class Camera>
struct keyframe_view {
  using descriptor_type = Descriptor;  ///< of the keypoints.
  using camera_type = Camera;          ///< of the rig.

  int keypoint_count = 0;                ///< N
  const vec2<float>* pixel = nullptr;    ///< N; undistorted (pinhole) or raw (any other model), px
  const vec3<float>* bearing = nullptr;  ///< N; unit rays in the frame of the camera that saw the keypoint
  const std::uint8_t* octave = nullptr;  ///< N; pyramid level
  const std::uint8_t* camera = nullptr;  ///< N; camera of the rig, below camera_count; null: all in 0
  const float* angle = nullptr;          ///< N; degrees; null: unknown (rotation filter refuses)
  const float* u_right = nullptr;        ///< N; px, < 0 none; null: none at all
  const float* depth = nullptr;          ///< N; m, < 0 unknown; null: all unknown
  const typename Descriptor::element* descriptor = nullptr;  ///< N * Descriptor::elements
  cell_index_view cells;                                     ///< columns == 0: no cell index
  group_index_view groups;                                   ///< group_count == 0: no groups
  const rig_camera<Camera>* cameras = nullptr;               ///< of the rig
  int camera_count = 0;                                      ///< of the rig

  /// Which camera saw a keypoint.
  TURBOMAP_HD int camera_of(int keypoint) const { return camera == nullptr ? 0 : camera[keypoint]; }
  /// Whether a keypoint has u_right.
  TURBOMAP_HD bool is_stereo(int keypoint) const { return u_right != nullptr && u_right[keypoint] >= 0; }
  /// The descriptor of a keypoint. None of the three is checked.
  TURBOMAP_HD const typename Descriptor::element* descriptor_of(int keypoint) const {
    return descriptor + static_cast<std::size_t>(keypoint) * Descriptor::elements;
  }
};

/// A keyframe as the host hands it to the store: the same arrays in host memory, before bearings and indices are made.
template <class Descriptor, class Camera>
struct keyframe_data {
  using descriptor_type = Descriptor;  ///< of the keypoints.
  using camera_type = Camera;          ///< of the rig.

  int keypoint_count = 0;                                     ///< N
  const keypoint* keypoints = nullptr;                        ///< N
  const typename Descriptor::element* descriptors = nullptr;  ///< N * Descriptor::elements
  const rig_camera<Camera>* cameras = nullptr;                ///< of the rig
  int camera_count = 0;                                       ///< of the rig
  image_bounds bounds;                                        ///< of every camera's image, px
};

}  // namespace turbomap
