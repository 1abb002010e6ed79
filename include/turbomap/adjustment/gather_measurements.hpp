// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The measurements of a problem, collected from resident keyframes: for each row (an observation of a landmark by a keypoint
/// of a frame) the pixel, its right column, its information and the camera that saw it.

#include <cstdint>

#include "../camera/rig_camera.hpp"
#include "../config.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "../store/keyframe_view.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Inputs and results, all in the memory of the policy.
template <class Descriptor, class Camera>
struct measurement_rows {
  const keyframe_view<Descriptor, Camera>* frames;  ///< keyframes, one per frame
  const std::int32_t* frame;                        ///< [row]
  const std::int32_t* keypoint;                     ///< [row], in its frame
  const float* sigma2;                              ///< [octave], px^2
  vec3<double>* pixel;                              ///< [row]: u, v, u_right (< 0: none)
  double* information;                              ///< [row]: 1 / sigma2
  std::uint8_t* camera;                             ///< [row], in the rig of the frame
  int count;                                        ///< of rows
};

/// Index = row.
template <class Descriptor, class Camera>
struct gather_measurement {
  measurement_rows<Descriptor, Camera> rows;  ///< what is read and written

  /// One row.
  TURBOMAP_HD void operator()(int row) const {
#if TURBOMAP_VECTOR_BYTES > 0
    constexpr int ahead = 16;  // rows are in the order of points, so their keypoints lie anywhere
    if (row + ahead < rows.count) {
      const auto& later = rows.frames[rows.frame[row + ahead]];
      const int k = rows.keypoint[row + ahead];
      prefetch(later.pixel + k, 1), prefetch(later.octave + k, 1);
      if (later.u_right != nullptr) prefetch(later.u_right + k, 1);
      if (later.camera != nullptr) prefetch(later.camera + k, 1);
    }
#endif
    const auto& view = rows.frames[rows.frame[row]];
    const int k = rows.keypoint[row];
    const vec2<float> z = view.pixel[k];
    const float u_right = view.u_right == nullptr ? -1.0F : view.u_right[k];
    rows.pixel[row] = {static_cast<double>(z.x), static_cast<double>(z.y), static_cast<double>(u_right)};
    rows.information[row] = 1 / static_cast<double>(rows.sigma2[view.octave[k]]);
    rows.camera[row] = static_cast<std::uint8_t>(view.camera_of(k));
  }
};

/// All rows.
template <class Derived, class Descriptor, class Camera>
void launch_gather_measurements(const thrust::execution_policy<Derived>& policy, int row_count,
                                const measurement_rows<Descriptor, Camera>& rows) {
  for_each_index(derived(policy), row_count, gather_measurement<Descriptor, Camera>{rows});
}

/// Index = frame: its cameras side by side, `most` places per frame.
template <class Descriptor, class Camera>
struct gather_rig {
  const keyframe_view<Descriptor, Camera>* frames;  ///< one per frame
  rig_camera<Camera>* cameras;                      ///< [frame][most]
  int most;                                         ///< cameras of any frame at most

  /// The rig of frame f.
  TURBOMAP_HD void operator()(int f) const {
    for (int c = 0; c < frames[f].camera_count; ++c) cameras[f * most + c] = frames[f].cameras[c];
  }
};

/// The rigs of all frames.
template <class Derived, class Descriptor, class Camera>
void launch_gather_rigs(const thrust::execution_policy<Derived>& policy, int frame_count,
                        const keyframe_view<Descriptor, Camera>* frames, rig_camera<Camera>* cameras, int most) {
  for_each_index(derived(policy), frame_count, gather_rig<Descriptor, Camera>{frames, cameras, most});
}

TURBOMAP_END_NAMESPACE
