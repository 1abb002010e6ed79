// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The fisheye camera of Kannala and Brandt (PAMI 2006) with four coefficients, as in OpenCV's fisheye module.

#include <algorithm>
#include <cmath>

#include "pinhole.hpp"
#include "radial.hpp"

namespace turbomap {

/// With theta = the angle between ray and optical axis and r = hypot(x, y): theta_d = theta (1 + k1 theta^2 + k2
/// theta^4 + k3 theta^6 + k4 theta^8), u = fx theta_d x/r + cx, v = fy theta_d y/r + cy. Fields of view beyond 180
/// degrees are fine: z may be zero or negative. Not defined straight behind the camera, and beyond the angle where
/// theta_d stops rising.
template <class T>
struct kannala_brandt {
  using scalar = T;  ///< of the parameters.
  T fx = 1;          ///< focal length along u, px per radian on the axis
  T fy = 1;          ///< focal length along v, px per radian on the axis
  T cx = 0;          ///< principal point, u, px
  T cy = 0;          ///< principal point, v, px
  T k1 = 0;          ///< of theta^3
  T k2 = 0;          ///< of theta^5
  T k3 = 0;          ///< of theta^7
  T k4 = 0;          ///< of theta^9

  /// The pixel of a point in camera coordinates. False, and `pixel` untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project(const vec3<S>& point, vec2<S>& pixel) const {
    S scale, slope, r2;
    if (!radial(point, scale, slope, r2)) return false;
    return detail::store_pixel<S>(S(fx) * (scale * point.x) + S(cx), S(fy) * (scale * point.y) + S(cy), pixel);
  }

  /// The unit ray of a pixel, in camera coordinates. False, and `bearing` untouched, for a pixel that no ray reaches.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& bearing) const {
    using std::sqrt;
    if (!detail::is_finite(pixel.x) || !detail::is_finite(pixel.y)) return false;
    const S mx = (pixel.x - S(cx)) / S(fx), my = (pixel.y - S(cy)) / S(fy), r2 = mx * mx + my * my;
    if (r2 <= S(0.25 * detail::epsilon<S>::value)) {  // theta = theta_d to the last bit; also keeps 0/0 away
      bearing = {mx, my, S(1)};
      return true;
    }
    const detail::radial_polynomial<S> d = polynomial<S>();
    const S theta_d = sqrt(r2), pi(3.14159265358979323846), tolerance(64 * detail::epsilon<S>::value);
    // Two steps from a good guess are enough nearly everywhere; what they do not find is searched for.
    S theta = d.guess(theta_d);
    bool found = false;
    for (int i = 0; i < 3 && !found; ++i) {
      theta = d.improved(theta, theta_d);
      found = d.solved(theta, theta_d, pi, S(4 * detail::epsilon<S>::value));
    }
    if (!found) {
      theta = d.solve(theta_d, pi);
      const S fold = d.first_fold(theta * theta);
      if (fold > S(0)) theta = d.solve(theta_d, sqrt(fold));  // the solution before the fold, if there is one
      const S error = theta * d.factor(theta * theta) - theta_d;
      if (!(error <= tolerance * theta_d && -error <= tolerance * theta_d)) return false;
    }
    S sine, cosine;
    sin_cos(theta, sine, cosine);
    const S scale = sine / theta_d;
    bearing = {scale * mx, scale * my, cosine};
    return true;
  }

  /// d pixel / d point, px per unit of the point. False, and untouched, where the model is not defined.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool jacobian(const vec3<S>& point, mat23<S>& d_pixel_d_point) const {
    S scale, slope, r2;
    if (!radial(point, scale, slope, r2)) return false;
    d_pixel_d_point = derivative(point, scale, slope, r2);
    return true;
  }

  /// Both at once: the angle, which takes longest, is computed once.
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool project_with_jacobian(const vec3<S>& point, vec2<S>& pixel, mat23<S>& d_pixel_d_point) const {
    S scale, slope, r2;
    if (!radial(point, scale, slope, r2)) return false;
    if (!detail::store_pixel<S>(S(fx) * (scale * point.x) + S(cx), S(fy) * (scale * point.y) + S(cy), pixel))
      return false;
    d_pixel_d_point = derivative(point, scale, slope, r2);
    return true;
  }

  /// False: its image is not rectilinear.
  TURBOMAP_HD bool as_pinhole(pinhole<double>&) const { return false; }

  /// Two pixels are at least this many px apart per radian between their rays: the least of the radial resolution f
  /// theta_d' and the tangential one f theta_d / sin(theta), at 512 angles out to the corner farthest from the
  /// principal point and 16 px more, times 0.97 for what lies between the samples. 0 when that corner has no ray.
  double min_pixels_per_radian(const image_bounds& bounds) const {
    constexpr double margin = 16, safety = 0.97;
    constexpr int samples = 512;
    const double x = std::max(std::abs(bounds.min_x - margin - cx), std::abs(bounds.max_x + margin - cx)) / fx;
    const double y = std::max(std::abs(bounds.min_y - margin - cy), std::abs(bounds.max_y + margin - cy)) / fy;
    vec3<double> corner;
    if (!unproject(vec2<double>{cx + fx * x, cy + fy * y}, corner)) return 0;
    const double end = std::atan2(std::hypot(corner.x, corner.y), corner.z);
    const auto d = polynomial<double>();
    double least = 1;  // on the axis both are f
    for (int i = 1; i <= samples; ++i) {
      const double theta = end * i / samples, z = theta * theta, sine = std::sin(theta);
      least = std::min(least, d.slope(z));
      if (sine > 0) least = std::min(least, theta * d.factor(z) / sine);
    }
    return std::max(0.0, safety * least * std::min<double>(fx, fy));
  }

  /// Throws std::invalid_argument naming the parameter that no camera can have.
  void validate() const {
    detail::validate_intrinsics(*this);
    require(detail::is_finite(k1), "k1", k1, "a distortion coefficient must be finite");
    require(detail::is_finite(k2), "k2", k2, "a distortion coefficient must be finite");
    require(detail::is_finite(k3), "k3", k3, "a distortion coefficient must be finite");
    require(detail::is_finite(k4), "k4", k4, "a distortion coefficient must be finite");
  }

 private:
  template <class S, class = detail::this_target>
  TURBOMAP_HD detail::radial_polynomial<S> polynomial() const {
    return {S(k1), S(k2), S(k3), S(k4)};
  }

  /// Of the pixel by the point, from what radial() says of it.
  template <class S, class = detail::this_target>
  TURBOMAP_HD mat23<S> derivative(const vec3<S>& point, const S& scale, const S& slope, const S& r2) const {
    const S x = point.x, y = point.y, along = slope / (r2 + point.z * point.z);
    // scale = theta_d / r depends on x, y through r alone: d scale / dx = x * curve.
    const S curve = r2 > S(0) ? (along * point.z - scale) / r2 : S(0);
    return {{S(fx) * (scale + x * x * curve), S(fx) * (x * y * curve), -(S(fx) * (x * along)), S(fy) * (x * y * curve),
             S(fy) * (scale + y * y * curve), -(S(fy) * (y * along))}};
  }

  /// scale = theta_d / r, slope = d theta_d / d theta, r2 = x^2 + y^2 (0 when too close to the axis to matter).
  template <class S, class = detail::this_target>
  TURBOMAP_HD bool radial(const vec3<S>& point, S& scale, S& slope, S& r2) const {
    using std::atan2;
    using std::sqrt;
    r2 = point.x * point.x + point.y * point.y;
    if (point.z > S(0) && r2 <= S(0.25 * detail::epsilon<S>::value) * (point.z * point.z)) {
      r2 = S(0), slope = S(1), scale = S(1) / point.z;
      return true;
    }
    if (!(r2 > S(0))) return false;
    const S r = sqrt(r2), theta = atan2(r, point.z), z = theta * theta;
    const detail::radial_polynomial<S> d = polynomial<S>();
    if (d.first_fold(z) > S(0)) return false;
    slope = d.slope(z);
    scale = theta * d.factor(z) / r;
    return true;
  }
};

}  // namespace turbomap
