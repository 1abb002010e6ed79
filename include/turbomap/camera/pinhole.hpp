// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pinhole camera, and the two helpers that every camera model here uses.

#include <cmath>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Writes the pixel and returns true when it is a number; else leaves it alone and returns false.
template <class S>
TURBOMAP_HD bool store_pixel(const S& u, const S& v, vec2<S>& pixel) {
  if (!is_finite(u) || !is_finite(v)) return false;
  pixel.x = u, pixel.y = v;
  return true;
}

/// Throws std::invalid_argument naming the parameter when a focal length is not a positive number, or a principal point
/// is not a number.
template <class Camera>
void validate_intrinsics(const Camera& camera) {
  require(is_finite(camera.fx) && camera.fx > 0, "fx", camera.fx, "a focal length must be finite and positive");
  require(is_finite(camera.fy) && camera.fy > 0, "fy", camera.fy, "a focal length must be finite and positive");
  require(is_finite(camera.cx), "cx", camera.cx, "the principal point must be finite");
  require(is_finite(camera.cy), "cy", camera.cy, "the principal point must be finite");
}

}  // namespace detail

TURBOMAP_END_NAMESPACE

namespace turbomap {

/// Pinhole: u = fx x/z + cx, v = fy y/z + cy, in pixels; defined in front of the camera, z > 0.
template <class T>
struct pinhole {
  using scalar = T;  ///< of the parameters.
  T fx = 1;          ///< focal length along u, px
  T fy = 1;          ///< focal length along v, px
  T cx = 0;          ///< principal point, u, px
  T cy = 0;          ///< principal point, v, px

  /// The pixel of a point in camera coordinates. False, and `pixel` untouched, where z <= 0 or the result is not
  /// finite.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const {
    if (!(point.z > S(0))) return false;
    return detail::store_pixel<S>(S(fx) * (point.x / point.z) + S(cx), S(fy) * (point.y / point.z) + S(cy), pixel);
  }

  /// The unit ray of a pixel, in camera coordinates. False, and `bearing` untouched, for a pixel that is not finite.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const {
    using std::sqrt;
    if (!detail::is_finite(pixel.x) || !detail::is_finite(pixel.y)) return false;
    const S mx = (pixel.x - S(cx)) / S(fx), my = (pixel.y - S(cy)) / S(fy);
    const S length = sqrt(mx * mx + my * my + S(1));
    bearing = {mx / length, my / length, S(1) / length};
    return true;
  }

  /// d pixel / d point, px per unit of the point. False, and untouched, where project() is false because of z <= 0.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    if (!(point.z > S(0))) return false;
    const S x = point.x / point.z, y = point.y / point.z, a = S(fx) / point.z, b = S(fy) / point.z;
    d_pixel_d_point = {{a, S(0), -(a * x), S(0), b, -(b * y)}};
    return true;
  }

  /// This camera itself: straight lines stay straight in its image.
  TURBOMAP_HD bool as_pinhole(pinhole<double>& equivalent) const {
    equivalent.fx = static_cast<double>(fx), equivalent.fy = static_cast<double>(fy);
    equivalent.cx = static_cast<double>(cx), equivalent.cy = static_cast<double>(cy);
    return true;
  }

  /// Two pixels are at least this many px apart per radian between their rays: least on the optical axis.
  double min_pixels_per_radian(const image_bounds&) const { return static_cast<double>(fx < fy ? fx : fy); }

  /// Throws std::invalid_argument naming the parameter that no camera can have.
  void validate() const { detail::validate_intrinsics(*this); }
};

}  // namespace turbomap
