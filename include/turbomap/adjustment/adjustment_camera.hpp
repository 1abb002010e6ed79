// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A camera as reprojections compute with it: its mount as a matrix, and its model in double where it is one that is
/// computed in packs.

#include <cmath>

#include "../camera/any_camera.hpp"
#include "../camera/camera_concept.hpp"
#include "../camera/kannala_brandt.hpp"
#include "../camera/pinhole.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// True, with the model in double, where a camera is of this model: it is computed in packs then.
template <class Camera>
bool as_kannala_brandt(const Camera&, kannala_brandt<double>&) {
  return false;
}
/// Such a camera: takes its parameters.
template <class T>
bool as_kannala_brandt(const kannala_brandt<T>& c, kannala_brandt<double>& model) {
  model.fx = c.fx, model.fy = c.fy, model.cx = c.cx, model.cy = c.cy;
  model.k1 = c.k1, model.k2 = c.k2, model.k3 = c.k3, model.k4 = c.k4;
  return true;
}
/// Any camera: asks the one that is held.
template <class... Cameras>
bool as_kannala_brandt(const any_camera<Cameras...>& c, kannala_brandt<double>& model) {
  bool is = false;
  c.visit([&](const auto& held) { is = as_kannala_brandt(held, model); });
  return is;
}

/// Models whose type says which formulas apply: the others are not compiled for them.
template <class Camera>
inline constexpr bool is_pinhole_v = false;
/// A pinhole is one.
template <class T>
inline constexpr bool is_pinhole_v<pinhole<T>> = true;
/// Models of which some camera may be a Kannala-Brandt one.
template <class Camera>
inline constexpr bool may_be_kannala_brandt_v = false;
/// Kannala-Brandt is one.
template <class T>
inline constexpr bool may_be_kannala_brandt_v<kannala_brandt<T>> = true;
/// Any camera may be one if it can hold one.
template <class... Cameras>
inline constexpr bool may_be_kannala_brandt_v<any_camera<Cameras...>> = (may_be_kannala_brandt_v<Cameras> || ...);

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

/// Throws std::invalid_argument.
inline void require_correlation(double correlation, const char* argument) {
  require(correlation >= 0 && correlation < 1, argument, correlation, "must be at least 0 and below 1");
}

TURBOMAP_END_NAMESPACE
