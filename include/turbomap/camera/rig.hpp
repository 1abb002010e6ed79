// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cameras mounted on one body. A keyframe's pose is that of the body; each camera adds its own place on it.

#include <cmath>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "../types.hpp"
#include "camera_concept.hpp"
#include "rig_camera.hpp"

namespace turbomap {

/// N cameras of one type on one body; any_camera makes rigs of mixed models.
template <class Camera, int N>
struct rig {
  static_assert(N > 0, "turbomap: a rig has at least one camera");
  using camera_type = Camera;     ///< the model of all of them.
  rig_camera<Camera> cameras[N];  ///< in the order of keypoint::camera.

  /// How many.
  TURBOMAP_HD static constexpr int size() { return N; }
  /// Camera i.
  TURBOMAP_HD constexpr const rig_camera<Camera>& operator[](int i) const { return cameras[i]; }
  /// Valid as long as the rig.
  rig_view<Camera> view() const { return {cameras, N}; }
};

/// One camera; also a rectified stereo pair seen as its left image plus u_right (set bf).
template <class Camera>
using mono_rig = rig<Camera, 1>;
/// Two cameras treated as two views.
template <class Camera>
using stereo_rig = rig<Camera, 2>;

/// A rig of one camera that is its own body; `bf` (px m) makes it a rectified stereo pair.
template <class Camera>
mono_rig<Camera> make_mono_rig(const Camera& camera, double bf = 0) {
  static_assert(require_camera<Camera>());
  return {{{camera, {}, bf, {}}}};
}

/// A rig of two cameras whose body is the left one; `T_right_left` maps left to right camera coordinates.
template <class Camera>
stereo_rig<Camera> make_stereo_rig(const Camera& left, const Camera& right,
                                   const rigid_transform<double>& T_right_left) {
  static_assert(require_camera<Camera>());
  return {{{left, {}, 0, {}}, {right, T_right_left, 0, {}}}};
}

/// Throws std::invalid_argument when a rig has no camera, a camera that cannot be, a transform that is not finite or
/// whose quaternion is not of unit length within 1e-3, or a negative bf.
template <class Camera>
void validate_rig(const rig_view<Camera>& rig) {
  static_assert(require_camera<Camera>());
  require(rig.count > 0 && rig.cameras != nullptr, "rig.count", rig.count, "a rig has at least one camera");
  for (int i = 0; i < rig.count; ++i) {
    const rig_camera<Camera>& c = rig[i];
    const rigid_transform<double>& T = c.T_camera_body;
    validate_camera(c.camera);
    const double n = std::sqrt(T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw);
    require(detail::is_finite(n) && std::abs(n - 1) < 1e-3, "T_camera_body quaternion norm", n, "must be 1");
    const double elements[3] = {T.tx, T.ty, T.tz};
    for (const double t : elements) require(detail::is_finite(t), "T_camera_body translation", t, "must be finite");
    check_not_negative("bf", static_cast<double>(c.bf));
  }
}
/// The same of a rig.
template <class Camera, int N>
void validate_rig(const rig<Camera, N>& rig) {
  validate_rig(rig.view());
}

}  // namespace turbomap
