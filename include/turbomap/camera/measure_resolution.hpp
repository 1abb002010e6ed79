// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Measures the resolution profile of a camera model: sampled on the host, once per rig.

#include <algorithm>
#include <cmath>

#include "../config.hpp"
#include "../types.hpp"
#include "camera_concept.hpp"
#include "resolution_profile.hpp"

namespace turbomap {

/// Measures a camera by its Jacobian, at 9 angles per entry and 64 directions around the axis, so that a small image far from
/// the axis has several too; 5 % are taken off for what lies between the samples, and no entry is below
/// min_pixels_per_radian(). At most a millisecond or two: once per rig.
template <class Camera, class = detail::this_target>
resolution_profile measure_resolution(const Camera& camera, const image_bounds& bounds) {
  resolution_profile profile;
  const double least = min_pixels_per_radian(camera, bounds);
  for (float& p : profile.pixels_per_radian) p = static_cast<float>(least);
  if constexpr (has_jacobian_v<Camera>) {
    if (!(least > 0)) return profile;
    constexpr double pi = 3.141592653589793;
    constexpr int angles = 8, directions = 64;
    const double reach = resolution_profile::margin / least;
    vec2<double> around[directions];
    for (int d = 0; d < directions; ++d)
      around[d] = {std::cos(2 * pi * d / directions), std::sin(2 * pi * d / directions)};
    for (int i = 0; i < resolution_profile::entries; ++i) {
      const double from = std::max(std::acos(1 - i / 16.0) - reach, 0.0);
      const double to = std::min(std::acos(1 - (i + 1) / 16.0) + reach, pi);
      double smallest = HUGE_VAL;
      for (int a = 0; a <= angles; ++a) {
        const double theta = from + (to - from) * a / angles, across = std::sin(theta), along = std::cos(theta);
        for (const vec2<double>& direction : around) {
          const vec3<double> ray{across * direction.x, across * direction.y, along};
          vec2<double> pixel;
          if (!camera.project(ray, pixel)) continue;
          const double m = resolution_profile::margin;
          if (pixel.x < bounds.min_x - m || pixel.x > bounds.max_x + m || pixel.y < bounds.min_y - m ||
              pixel.y > bounds.max_y + m)
            continue;  // no keypoint is there
          mat23<double> J;
          if (!camera.jacobian(ray, J)) continue;
          const double p = J(0, 0) * J(0, 0) + J(0, 1) * J(0, 1) + J(0, 2) * J(0, 2);
          const double q = J(0, 0) * J(1, 0) + J(0, 1) * J(1, 1) + J(0, 2) * J(1, 2);
          const double r = J(1, 0) * J(1, 0) + J(1, 1) * J(1, 1) + J(1, 2) * J(1, 2);
          smallest = std::min(smallest, (p + r - std::hypot(p - r, 2 * q)) / 2);
        }
      }
      if (smallest < HUGE_VAL && smallest > 0)
        profile.pixels_per_radian[i] = static_cast<float>(std::max(least, 0.95 * std::sqrt(smallest)));
    }
  }
  return profile;
}

}  // namespace turbomap
