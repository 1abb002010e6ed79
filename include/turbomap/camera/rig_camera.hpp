// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One camera of a rig, and a view of several, as plain data.

#include "../config.hpp"
#include "../types.hpp"
#include "resolution_profile.hpp"

namespace turbomap {

/// One camera of a rig.
template <class Camera>
struct rig_camera {
  Camera camera;                          ///< its model
  rigid_transform<double> T_camera_body;  ///< maps body to camera coordinates, metres; identity: the camera is the body
  /// Focal length times baseline, px m, of a rectified stereo pair whose left image this is: u_right = u - bf / depth.
  /// 0: there is no right image.
  double bf = 0;
  /// measure_resolution(camera, bounds): makes windows of an epipolar-ordered search on a curved image. The keyframe
  /// store measures what comes unmeasured.
  resolution_profile resolution = {};
};

/// The cameras of a rig wherever they are stored, of a number known at run time only.
template <class Camera>
struct rig_view {
  const rig_camera<Camera>* cameras = nullptr;  ///< in the memory of whoever reads them
  int count = 0;                                ///< of cameras

  /// How many cameras.
  TURBOMAP_HD constexpr int size() const { return count; }
  /// \param i  below size(); not checked
  TURBOMAP_HD constexpr const rig_camera<Camera>& operator[](int i) const { return cameras[i]; }
};

}  // namespace turbomap
