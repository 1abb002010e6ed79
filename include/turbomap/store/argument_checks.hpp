// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What every search demands of the keyframes and the pyramid that it is given, with the same messages everywhere.

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "../math/rotation.hpp"
#include "../math/scale_table.hpp"
#include "../memory.hpp"
#include "../types.hpp"
#include "keyframe_validation.hpp"
#include "keyframe_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument when the pyramid of some options cannot be.
inline void check_scales(const pyramid& scales) {
  require(scales.levels >= 1 && scales.levels <= scale_table_size, "options.scales.levels", scales.levels,
          "must be in [1, 256]: octaves are bytes");
  check_factor("options.scales.scale_factor", static_cast<double>(scales.scale_factor));
  require(scales.levels == 1 || scales.scale_factor > 1, "options.scales.scale_factor", scales.scale_factor,
          "must be above 1 where there are several levels");
}

/// Throws std::invalid_argument when a pose is not finite, or its quaternion not of unit length within 1e-3.
inline void check_pose(const argument_name& keyframe, const rigid_transform<double>& T) {
  if (is_pose(T)) return;
  const double sum = T.qx + T.qy + T.qz + T.qw + T.tx + T.ty + T.tz;
  const double norm = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
  if (!detail::is_finite(sum)) reject(keyframe + ".T_cw", sum, "a pose must be finite");
  reject(keyframe + ".T_cw squared quaternion norm", norm, "must be 1");
}
/// Throws std::invalid_argument when a view has a negative number of keypoints.
template <class Descriptor, class Camera>
void check_keypoint_count(const argument_name& keyframe, const keyframe_view<Descriptor, Camera>& view) {
  if (!(view.keypoint_count >= 0))
    reject(keyframe + ".view.keypoint_count", view.keypoint_count, "must not be negative");
}
/// Throws std::invalid_argument when a view has no camera.
template <class Descriptor, class Camera>
void check_rig(const argument_name& keyframe, const keyframe_view<Descriptor, Camera>& view) {
  if (!(view.camera_count >= 1 && view.cameras != nullptr))
    reject(keyframe + ".view.camera_count", view.camera_count, "a keyframe needs a rig of at least one camera");
}

/// \name Whether keypoints name cameras that the rig has
/// Looked at where the host can: a view of the store is sound, one that a user has made may not be.
/// @{
/// Throws std::invalid_argument when a keypoint names a camera that is not there. Linear in the keypoints.
template <class Descriptor, class Camera>
void check_cameras(host_memory, const argument_name& keyframe, const keyframe_view<Descriptor, Camera>& view) {
  if (!has_cameras(view)) require_cameras(view, (keyframe + ".view").c_str());
}
/// Does nothing.
template <class Descriptor, class Camera>
void check_cameras(device_memory, const argument_name&, const keyframe_view<Descriptor, Camera>&) {}
/// @}

TURBOMAP_END_NAMESPACE
