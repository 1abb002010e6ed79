// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A camera as reprojections compute with it: its mount as a matrix, and its model in double where it is one that is
/// computed in packs.

#include <cmath>

#include "../camera/camera_concept.hpp"
#include "../camera/known_models.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A camera of the rig, prepared.
template <class Camera>
struct adjustment_camera {
  Camera camera;                   ///< its own model
  isometry<double> T_camera_body;  ///< body to camera, m
  pinhole<double> K;               ///< where straight
  kannala_brandt<double> fisheye;  ///< where round
  double bf;                       ///< baseline times focal length, px m; 0: no right image
  double correlation;              ///< of the errors of u and u_right
  double whitening;                ///< 1 / sqrt(1 - correlation^2)
  double nearest = 0;              ///< rows closer than this are not defined, in units of the map
  bool straight;                   ///< a pinhole: computed in packs
  bool round;                      ///< a Kannala-Brandt camera: the same
  bool is_body;                    ///< T_camera_body is the identity

  adjustment_camera() = default;
  /// \param stereo_correlation  of the errors of u and u_right, in [0, 1)
  TURBOMAP_ONE_BODY explicit adjustment_camera(const rig_camera<Camera>& c, double stereo_correlation = 0)
      : camera(c.camera),
        T_camera_body(to_isometry<double>(c.T_camera_body)),
        K(),
        fisheye(),
        bf(c.bf),
        correlation(stereo_correlation),
        whitening(1 / std::sqrt(1 - stereo_correlation * stereo_correlation)) {
    straight = as_pinhole(c.camera, K);
    round = as_kannala_brandt(c.camera, fisheye);
    const auto& T = c.T_camera_body;
    is_body = T.qx == 0 && T.qy == 0 && T.qz == 0 && T.tx == 0 && T.ty == 0 && T.tz == 0;
  }
};

TURBOMAP_END_NAMESPACE
