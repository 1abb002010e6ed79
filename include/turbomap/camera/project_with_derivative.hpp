// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pixel of a point together with its derivative by the point, for any camera model.

#include <type_traits>

#include "../config.hpp"
#include "../math/dual.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "../types.hpp"
#include "camera_concept.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Central differences: what strict numbers take, because dual numbers are not strict. Steps of 1e-6 of the distance.
template <class S, class Camera>
TURBOMAP_HD bool difference_pixels(const Camera& camera, const vec3<S>& p, mat23<S>& d) {
  const S step = S(1e-6) * norm(p);
  if (!(step > S(0))) return false;
  for (int i = 0; i < 3; ++i) {
    const vec3<S> move{i == 0 ? step : S(0), i == 1 ? step : S(0), i == 2 ? step : S(0)};
    vec2<S> after, before;
    if (!camera.project(p + move, after) || !camera.project(p - move, before)) return false;
    d(0, i) = (after.x - before.x) / (step + step);
    d(1, i) = (after.y - before.y) / (step + step);
  }
  return true;
}

}  // namespace detail

/// Pixel and derivative (px per unit of the point) of one point in camera coordinates. Where the model has no derivative:
/// dual numbers for S = double, differences for strict numbers. False where the model is not defined.
template <class Camera, class S>
TURBOMAP_HD bool project_with_derivative(const Camera& camera, const vec3<S>& p, vec2<S>& pixel, mat23<S>& d) {
  if constexpr (has_project_with_jacobian_v<Camera>) {
    if (camera.project_with_jacobian(p, pixel, d)) return true;
  }
  if (!camera.project(p, pixel)) return false;
  if constexpr (has_jacobian_v<Camera>) {
    if (camera.jacobian(p, d)) return true;
  }
  if constexpr (std::is_same_v<S, double>) {
    using D = dual<3>;
    vec2<D> q;
    if (!camera.project(vec3<D>{D::variable(p.x, 0), D::variable(p.y, 1), D::variable(p.z, 2)}, q)) return false;
    for (int i = 0; i < 3; ++i) d(0, i) = q.x.d[i], d(1, i) = q.y.d[i];
    return true;
  } else {
    return detail::difference_pixels(camera, p, d);
  }
}

TURBOMAP_END_NAMESPACE
