// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pinhole camera with radial and tangential lens distortion of Brown and Conrady, five coefficients as in OpenCV.

#include <cmath>

#include "pinhole.hpp"
#include "radial.hpp"
#include "sampled_resolution.hpp"

namespace turbomap {

/// With a = x/z, b = y/z, r^2 = a^2 + b^2 and g = 1 + k1 r^2 + k2 r^4 + k3 r^6:
/// u = fx (a g + 2 p1 a b + p2 (r^2 + 2 a^2)) + cx, v = fy (b g + p1 (r^2 + 2 b^2) + 2 p2 a b) + cy.
/// Not defined behind the camera, z <= 0, nor beyond the radius where r g stops rising. Tangential terms may fold the
/// image a little before that: it is not looked for, since every projection would have to derive.
template <class T>
struct brown_conrady {
  using scalar = T;  ///< of the parameters.
  T fx = 1;          ///< focal length along u, px
  T fy = 1;          ///< focal length along v, px
  T cx = 0;          ///< principal point, u, px
  T cy = 0;          ///< principal point, v, px
  T k1 = 0;          ///< radial, of r^2
  T k2 = 0;          ///< radial, of r^4
  T p1 = 0;          ///< tangential, along v
  T p2 = 0;          ///< tangential, along u
  T k3 = 0;          ///< radial, of r^6; in OpenCV's order of the five

  /// The pixel of a point in camera coordinates. False, and `pixel` untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const {
    if (!(point.z > S(0))) return false;
    const vec2<S> ideal{point.x / point.z, point.y / point.z};
    if (radial<S>().first_fold(ideal.x * ideal.x + ideal.y * ideal.y) > S(0)) return false;
    const vec2<S> d = distort(ideal);
    return detail::store_pixel<S>(S(fx) * d.x + S(cx), S(fy) * d.y + S(cy), pixel);
  }

  /// The unit ray of a pixel, in camera coordinates, by Newton's method. False, and `bearing` untouched, for a pixel
  /// that no ray reaches.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const {
    using std::sqrt;
    if (!detail::is_finite(pixel.x) || !detail::is_finite(pixel.y)) return false;
    const vec2<S> goal{(pixel.x - S(cx)) / S(fx), (pixel.y - S(cy)) / S(fy)};
    // A solution to rounding is taken; another step is made even when the residual is zero, for the sake of dual
    // numbers.
    const S unit(detail::epsilon<S>::value), size = S(1) + goal.x * goal.x + goal.y * goal.y;
    const S small = S(16) * unit * unit * size, acceptable = S(4096) * unit * unit * size;
    // From the pixel itself, which is near for any usual lens. A strong distortion may put it beyond the fold though its
    // ray is not: then from the solution without tangential terms, with steps that do not lead over the fold.
    vec2<S> ideal = goal;
    S r2(0);
    bool found = false;
    for (int start = 0; start < 2 && !found; ++start) {
      const bool careful = start == 1;
      if (careful) ideal = radial_solution(goal);
      vec2<S> before{S(0), S(0)};  // the axis, which is within the fold
      S residual(0);
      for (int i = 0; i < (careful ? 60 : 30); ++i) {
        const vec2<S> d = distort(ideal);
        const vec2<S> e{d.x - goal.x, d.y - goal.y};
        S a, b, c;  // the symmetric Jacobian [a b; b c]
        distortion_jacobian(ideal, a, b, c);
        const S determinant = a * c - b * b;
        residual = e.x * e.x + e.y * e.y;
        if (!(determinant > S(0)) || (careful && !(a + c > S(0)))) {
          residual = S(1e30);  // it is none of a solution
          if (!careful) break;
          ideal = {S(0.5) * (before.x + ideal.x), S(0.5) * (before.y + ideal.y)};
          continue;
        }
        before = ideal;
        ideal = {ideal.x - (c * e.x - b * e.y) / determinant, ideal.y - (a * e.y - b * e.x) / determinant};
        if (residual <= small) break;
      }
      r2 = ideal.x * ideal.x + ideal.y * ideal.y;
      found = residual <= acceptable && !(radial<S>().first_fold(r2) > S(0));
    }
    if (!found) return false;
    const S length = sqrt(r2 + S(1));
    bearing = {ideal.x / length, ideal.y / length, S(1) / length};
    return true;
  }

  /// d pixel / d point, px per unit of the point. False, and untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    if (!(point.z > S(0))) return false;
    const vec2<S> i{point.x / point.z, point.y / point.z};
    if (radial<S>().first_fold(i.x * i.x + i.y * i.y) > S(0)) return false;
    S a, b, c;
    distortion_jacobian(i, a, b, c);
    const S f = S(fx) / point.z, g = S(fy) / point.z;
    d_pixel_d_point = {{f * a, f * b, -(f * (a * i.x + b * i.y)), g * b, g * c, -(g * (b * i.x + c * i.y))}};
    return true;
  }

  /// False: its image is not rectilinear.
  TURBOMAP_HD bool as_pinhole(pinhole<double>&) const { return false; }

  /// Two pixels are at least this many px apart per radian between their rays; sampled (see sampled_resolution.hpp), 0
  /// when a part of the image has no ray.
  double min_pixels_per_radian(const image_bounds& bounds) const {
    return detail::sampled_min_pixels_per_radian(*this, bounds);
  }

  /// Throws std::invalid_argument naming the parameter that no camera can have.
  void validate() const {
    detail::validate_intrinsics(*this);
    require(detail::is_finite(k1), "k1", k1, "a distortion coefficient must be finite");
    require(detail::is_finite(k2), "k2", k2, "a distortion coefficient must be finite");
    require(detail::is_finite(p1), "p1", p1, "a distortion coefficient must be finite");
    require(detail::is_finite(p2), "p2", p2, "a distortion coefficient must be finite");
    require(detail::is_finite(k3), "k3", k3, "a distortion coefficient must be finite");
  }

 private:
  template <class S, class = detail::this_target>
  TURBOMAP_HD detail::radial_polynomial<S> radial() const {
    return {S(k1), S(k2), S(k3), S(0)};
  }

  template <class S, class = detail::this_target>
  TURBOMAP_HD vec2<S> distort(const vec2<S>& i) const {
    const S aa = i.x * i.x, bb = i.y * i.y, ab2 = S(2) * (i.x * i.y), r2 = aa + bb, g = radial<S>().factor(r2);
    return {i.x * g + (S(p1) * ab2 + S(p2) * (r2 + S(2) * aa)), i.y * g + (S(p1) * (r2 + S(2) * bb) + S(p2) * ab2)};
  }

  /// About the ideal point of a distorted one: the tangential terms are left out.
  template <class S, class = detail::this_target>
  TURBOMAP_HD vec2<S> radial_solution(const vec2<S>& distorted) const {
    using std::sqrt;
    const detail::radial_polynomial<S> d = radial<S>();
    const S goal = sqrt(distorted.x * distorted.x + distorted.y * distorted.y);
    S r = d.solve(goal, S(100));  // 89.4 degrees off the axis
    const S fold = d.first_fold(r * r);
    if (fold > S(0)) r = d.solve(goal, sqrt(fold));
    const S scale = r / goal;
    return {scale * distorted.x, scale * distorted.y};
  }

  /// d distort = [a b; b c].
  template <class S, class = detail::this_target>
  TURBOMAP_HD void distortion_jacobian(const vec2<S>& i, S& a, S& b, S& c) const {
    const S r2 = i.x * i.x + i.y * i.y, g = radial<S>().factor(r2);
    const S dg = S(2) * (S(k1) + r2 * (S(2) * S(k2) + r2 * (S(3) * S(k3))));  // dg/da = a dg
    a = g + i.x * i.x * dg + S(2) * (S(p1) * i.y) + S(6) * (S(p2) * i.x);
    b = i.x * i.y * dg + S(2) * (S(p1) * i.x + S(p2) * i.y);
    c = g + i.y * i.y * dg + S(6) * (S(p1) * i.y) + S(2) * (S(p2) * i.x);
  }
};

}  // namespace turbomap
