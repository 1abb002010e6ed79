// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The double sphere camera of Usenko, Demmel and Cremers (3DV 2018): wide fields of view with a closed-form inverse.

#include <cmath>

#include "pinhole.hpp"
#include "sampled_resolution.hpp"

namespace turbomap {

/// With d1 = |(x, y, z)|, k = xi d1 + z, d2 = |(x, y, k)| and D = alpha d2 + (1 - alpha) k:
/// u = fx x/D + cx, v = fy y/D + cy (Eq. 40-42 there). Defined where z > -w2 d1 (Eq. 43-45), also behind the camera. With a negative
/// xi and an alpha near 1 the image folds over at its rim, two degrees or so before that: calibrations have no such parameters.
template <class T>
struct double_sphere {
  using scalar = T;  ///< of the parameters.
  T fx = 1;          ///< focal length along u, px
  T fy = 1;          ///< focal length along v, px
  T cx = 0;          ///< principal point, u, px
  T cy = 0;          ///< principal point, v, px
  T xi = 0;          ///< distance between the centres of the two unit spheres, (-1, 1]
  T alpha = 0.5;     ///< share of the second sphere, [0, 1]

  /// The pixel of a point in camera coordinates. False, and `pixel` untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const {
    S d1, k, d2, D;
    if (!denominator(point, d1, k, d2, D)) return false;
    return detail::store_pixel<S>(S(fx) * (point.x / D) + S(cx), S(fy) * (point.y / D) + S(cy), pixel);
  }

  /// The unit ray of a pixel, in camera coordinates (Eq. 46-52). False, and `bearing` untouched, for a pixel that no
  /// ray reaches.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const {
    using std::sqrt;
    if (!detail::is_finite(pixel.x) || !detail::is_finite(pixel.y)) return false;
    const S a(alpha), x_i(xi), one(1);
    const S mx = (pixel.x - S(cx)) / S(fx), my = (pixel.y - S(cy)) / S(fy), r2 = mx * mx + my * my;
    const S inside = one - (S(2) * a - one) * r2;
    if (!(inside >= S(0))) return false;
    const S mz = (one - a * a * r2) / (a * sqrt(inside) + (one - a));
    const S root = mz * mz + (one - x_i * x_i) * r2;
    if (!(root >= S(0))) return false;
    const S scale = (mz * x_i + sqrt(root)) / (mz * mz + r2);
    const vec3<S> ray{scale * mx, scale * my, scale * mz - x_i};
    if (!detail::is_finite(ray.x) || !detail::is_finite(ray.y) || !detail::is_finite(ray.z)) return false;
    if (!(ray.z > least_z<S>())) return false;
    bearing = ray;
    return true;
  }

  /// d pixel / d point, px per unit of the point. False, and untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    S d1, k, d2, D;
    if (!denominator(point, d1, k, d2, D)) return false;
    // dD = alpha dd2 + (1 - alpha) dk, dd2 = ((x, y, 0) + k dk) / d2, dk = xi point / d1 + (0, 0, 1).
    const S x = point.x, y = point.y, a(alpha), g = S(xi) / d1, h = a * k / d2 + (S(1) - a);
    const S dx = x * (a / d2 + h * g), dy = y * (a / d2 + h * g), dz = h * (g * point.z + S(1));
    const S m = x / D, n = y / D, p = S(fx) / D, q = S(fy) / D;
    d_pixel_d_point = {{p * (S(1) - m * dx), -(p * (m * dy)), -(p * (m * dz)),  //
                        -(q * (n * dx)), q * (S(1) - n * dy), -(q * (n * dz))}};
    return true;
  }

  /// False: its image is not rectilinear (but for xi = alpha = 0, which is a pinhole's job).
  TURBOMAP_HD bool as_pinhole(pinhole<double>&) const { return false; }

  /// Two pixels are at least this many px apart per radian between their rays; sampled (see sampled_resolution.hpp), 0
  /// when a part of the image has no ray.
  double min_pixels_per_radian(const image_bounds& bounds) const {
    return detail::sampled_min_pixels_per_radian(*this, bounds);
  }

  /// Throws std::invalid_argument naming the parameter that no camera can have.
  void validate() const {
    detail::validate_intrinsics(*this);
    require(detail::is_finite(xi) && xi > -1 && xi <= 1, "xi", xi, "must lie in (-1, 1]");
    require(detail::is_finite(alpha) && alpha >= 0 && alpha <= 1, "alpha", alpha, "must lie in [0, 1]");
  }

 private:
  /// Of a unit ray that the model is defined for: -w2.
  template <class S, class = detail::this_target>
  TURBOMAP_HD S least_z() const {
    using std::sqrt;
    const S a(alpha), x_i(xi), one(1);
    const S w1 = a <= S(0.5) ? a / (one - a) : (one - a) / a;
    return -((w1 + x_i) / sqrt(S(2) * w1 * x_i + x_i * x_i + one));
  }
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool denominator(const vec3<S>& p, S& d1, S& k, S& d2, S& D) const {
    using std::sqrt;
    const S a(alpha), x_i(xi), one(1), r2 = p.x * p.x + p.y * p.y;
    d1 = sqrt(r2 + p.z * p.z);
    if (!(p.z > least_z<S>() * d1)) return false;
    k = x_i * d1 + p.z;
    d2 = sqrt(r2 + k * k);
    D = a * d2 + (one - a) * k;
    return D > S(0);
  }
};

}  // namespace turbomap
