// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// min_pixels_per_radian() of a model that has no closed form: sampled over the image.

#include <algorithm>
#include <cmath>
#include <vector>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The square of the least singular value of d pixel / d ray at a unit ray, px^2 / rad^2. False where the model has no
/// derivative.
template <class Camera>
bool squared_resolution(const Camera& camera, const vec3<double>& ray, double& squared) {
  mat23<double> d;
  if (!camera.jacobian(ray, d)) return false;
  // A pixel does not change along its ray, so the singular values of d at the unit ray are those on its tangent plane.
  const double a = d(0, 0) * d(0, 0) + d(0, 1) * d(0, 1) + d(0, 2) * d(0, 2);
  const double b = d(0, 0) * d(1, 0) + d(0, 1) * d(1, 1) + d(0, 2) * d(1, 2);
  const double c = d(1, 0) * d(1, 0) + d(1, 1) * d(1, 1) + d(1, 2) * d(1, 2);
  squared = (a + c - std::hypot(a - c, 2 * b)) / 2;
  return true;
}

/// That of a pixel; 0 when it has no ray.
template <class Camera>
double squared_resolution(const Camera& camera, const vec2<double>& pixel) {
  vec3<double> ray;
  double squared = 0;
  return camera.unproject(pixel, ray) && squared_resolution(camera, ray, squared) ? squared : 0;
}

/// A part of the image, and the squared resolution at its corners.
struct resolution_cell {
  double x, y, width, height;  ///< px
  double corners[2][2];        ///< of row, column

  /// A lower bound within it, <= 0 for none: what is between the corners is less than the least of them by no more than the
  /// corners differ. Near a fold the resolution goes with the root of the distance in the image, and its square evenly.
  double bound() const {
    const auto [least, most] = std::minmax({corners[0][0], corners[0][1], corners[1][0], corners[1][1]});
    return least - (most - least);
  }
};

/// A lower bound of the squared resolution in a cell, and `enough` where it is no less. Cells that do not tell are cut in
/// four.
template <class Camera>
double bound_by_parts(const Camera& camera, const resolution_cell& cell, double enough, int depth) {
  const double bound = cell.bound();
  if (bound >= enough || !(enough > 0)) return enough;
  if (depth == 0) return std::max(bound, 0.0);
  double values[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      values[i][j] =
          i != 1 && j != 1
              ? cell.corners[i / 2][j / 2]
              : squared_resolution(camera, vec2<double>{cell.x + j * cell.width / 2, cell.y + i * cell.height / 2});
  double least = enough;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      const double w = cell.width / 2, h = cell.height / 2;
      const resolution_cell part{cell.x + j * w,
                                 cell.y + i * h,
                                 w,
                                 h,
                                 {{values[i][j], values[i][j + 1]}, {values[i + 1][j], values[i + 1][j + 1]}}};
      least = std::min(least, bound_by_parts(camera, part, least, depth - 1));
    }
  return least;
}

/// The least singular value of d pixel / d ray on a grid of 65 x 65 pixels over the image and 16 px around it, times
/// 0.8 for what lies between the samples; less where it changes by more than that from one to the next. 0 when any of them
/// has no ray.
template <class Camera>
double sampled_min_pixels_per_radian(const Camera& camera, const image_bounds& bounds) {
  constexpr double margin = 16, safety = 0.8;
  constexpr int samples = 64, depth = 4;
  const double x0 = bounds.min_x - margin, y0 = bounds.min_y - margin;
  const double dx = (bounds.max_x + margin - x0) / samples, dy = (bounds.max_y + margin - y0) / samples;
  std::vector<double> grid;
  for (int i = 0; i <= samples; ++i)
    for (int j = 0; j <= samples; ++j) {
      const double squared = squared_resolution(camera, vec2<double>{x0 + j * dx, y0 + i * dy});
      if (!is_finite(squared) || !(squared > 0)) return 0;
      grid.push_back(squared);
    }
  double least = safety * safety * *std::min_element(grid.begin(), grid.end());
  for (int i = 0; i < samples; ++i)
    for (int j = 0; j < samples; ++j) {
      const double* const row = grid.data() + i * (samples + 1) + j;
      const double* const next = row + samples + 1;
      const resolution_cell cell{x0 + j * dx, y0 + i * dy, dx, dy, {{row[0], row[1]}, {next[0], next[1]}}};
      least = std::min(least, bound_by_parts(camera, cell, least, depth));
    }
  return std::sqrt(least);
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
