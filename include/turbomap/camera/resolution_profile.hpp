// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Pixels per radian of a camera, by angle from the optical axis. Turns a tolerance in pixels into one in angle, for the
/// windows of an epipolar-ordered search on curved images.

#include "../config.hpp"

namespace turbomap {

/// Lower bounds of |pixel difference| / angle between rays, per interval of the cosine of the angle to the optical axis:
/// entry i holds for cosines in [1 - (i + 1) / 16, 1 - i / 16] and for everything within `margin` pixels of them. All 0:
/// unknown; every window is then the whole image.
struct resolution_profile {
  /// Rings that are told apart.
  static constexpr int entries = 32;
  static constexpr double margin = 16;  ///< px

  /// The least of each ring; 0: not measured.
  float pixels_per_radian[entries] = {};

  /// \param cosine  of the angle to the optical axis
  TURBOMAP_HD float at(float cosine) const {
    const float i = (1 - cosine) * (0.5F * entries);
    return pixels_per_radian[!(i > 0) ? 0 : i >= entries ? entries - 1 : static_cast<int>(i)];
  }
  /// Whether it was measured.
  bool known() const { return pixels_per_radian[0] > 0; }
};

}  // namespace turbomap
