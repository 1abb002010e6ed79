// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// min_pixels_per_radian() of a model that has no closed form: sampled over the image.

#include <algorithm>
#include <cmath>

#include "../config.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The least singular value of d pixel / d ray on a grid of 65 x 65 pixels over the image and 16 px around it, times
/// 0.8 for what lies between the samples. 0 when any of them has no ray.
template <class Camera>
double sampled_min_pixels_per_radian(const Camera& camera, const image_bounds& bounds) {
  constexpr double margin = 16, safety = 0.8;
  constexpr int samples = 64;
  const double x0 = bounds.min_x - margin, y0 = bounds.min_y - margin;
  const double dx = (bounds.max_x + margin - x0) / samples, dy = (bounds.max_y + margin - y0) / samples;
  double least = HUGE_VAL;
  for (int i = 0; i <= samples; ++i)
    for (int j = 0; j <= samples; ++j) {
      vec3<double> ray;
      mat23<double> d;
      if (!camera.unproject(vec2<double>{x0 + j * dx, y0 + i * dy}, ray) || !camera.jacobian(ray, d)) return 0;
      // A pixel does not change along its ray, so the singular values of d at the unit ray are those on its tangent
      // plane.
      const double a = d(0, 0) * d(0, 0) + d(0, 1) * d(0, 1) + d(0, 2) * d(0, 2);
      const double b = d(0, 0) * d(1, 0) + d(0, 1) * d(1, 1) + d(0, 2) * d(1, 2);
      const double c = d(1, 0) * d(1, 0) + d(1, 1) * d(1, 1) + d(1, 2) * d(1, 2);
      least = std::min(least, (a + c - std::hypot(a - c, 2 * b)) / 2);
    }
  return std::isfinite(least) && least > 0 ? safety * std::sqrt(least) : 0;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
