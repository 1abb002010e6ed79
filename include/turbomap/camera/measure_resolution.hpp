// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Measures the resolution profile of a camera model: sampled on the host, once per rig.

#include <algorithm>
#include <cmath>
#include <vector>

#include "../config.hpp"
#include "../types.hpp"
#include "camera_concept.hpp"
#include "resolution_profile.hpp"
#include "resolution_rings.hpp"
#include "sampled_resolution.hpp"

namespace turbomap {

/// Measures a camera by its Jacobian: a degree apart in 64 directions around the axis, and at 1024 pixels along the border of
/// what is seen, where the resolution of many a lens falls fastest. For what lies between the samples 3 % are taken off, 1 %
/// along the border, or more where neighbours differ by more; no entry is below min_pixels_per_radian(). A millisecond or
/// two, and ten where the image folds just beyond its border: once per rig.
template <class Camera, class = detail::this_target>
resolution_profile measure_resolution(const Camera& camera, const image_bounds& bounds) {
  resolution_profile profile;
  const double least = min_pixels_per_radian(camera, bounds);
  for (float& p : profile.pixels_per_radian) p = static_cast<float>(least);
  if constexpr (has_jacobian_v<Camera>) {
    if (!(least > 0)) return profile;
    constexpr double pi = 3.141592653589793, m = resolution_profile::margin, nothing = -1;
    constexpr int directions = 64, steps = 256;
    const vec2<double> low{bounds.min_x - m, bounds.min_y - m}, high{bounds.max_x + m, bounds.max_y + m};
    const auto inside = [&](const vec2<double>& p) {
      return p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y;
    };
    detail::resolution_rings rings(m / least);
    const std::vector<double> angles = rings.angles();
    std::vector<detail::resolution_rings::sample> path;
    for (int d = 0; d < directions; ++d) {
      const double x = std::cos(2 * pi * d / directions), y = std::sin(2 * pi * d / directions);
      path.clear();
      for (const double theta : angles) {
        const vec3<double> ray{std::sin(theta) * x, std::sin(theta) * y, std::cos(theta)};
        vec2<double> pixel;
        double squared = nothing;
        if (camera.project(ray, pixel) && inside(pixel)) detail::squared_resolution(camera, ray, squared);
        path.push_back({theta, squared});
      }
      rings.add(path, 0.03);
    }
    const vec2<double> corners[5] = {low, {high.x, low.y}, high, {low.x, high.y}, low};
    for (int side = 0; side < 4; ++side) {
      const vec2<double> a = corners[side], b = corners[side + 1];
      path.clear();
      for (int s = 0; s <= steps; ++s) {
        const double t = s / double{steps};
        vec3<double> ray;
        double squared;
        if (camera.unproject(vec2<double>{a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t}, ray) &&
            detail::squared_resolution(camera, ray, squared))
          path.push_back({std::atan2(std::hypot(ray.x, ray.y), ray.z), squared});
      }
      rings.add(path, 0.01);
    }
    for (int i = 0; i < resolution_profile::entries; ++i)
      if (rings.measured(i)) profile.pixels_per_radian[i] = static_cast<float>(std::max(least, rings.bound(i)));
  }
  return profile;
}

}  // namespace turbomap
