// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A keyframe as one call sees it.

#include <cstdint>

#include "../span.hpp"
#include "../types.hpp"
#include "keyframe_view.hpp"

namespace turbomap {

/// The immutable view, and what changes.
template <class Descriptor, class Camera>
struct posed_keyframe {
  keyframe_view<Descriptor, Camera> view;  ///< in the memory of the policy
  rigid_transform<double> T_cw;            ///< world to camera (to body for a rig with T_camera_body)
  /// In host memory, one byte per keypoint; not 0: it holds a map point. Empty: none does.
  span<const std::uint8_t> has_point = {};
};

}  // namespace turbomap
