// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tells in plain double, in a fraction of the time of the decision itself, that a point certainly has no match.
/// Wherever rounding could matter it says nothing: the plan is the same with and without it.

#include <cmath>

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../math/symmetric3.hpp"
#include "../store/keypoint_window.hpp"
#include "projection_test.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Rounding of a few operations, with much to spare.
constexpr double loose = 1e-9;
/// px; a projection in double is nearer than this to the decision's, while it is well conditioned.
constexpr double loose_pixels = 1e-3;
/// Derivatives are known better than this, by whatever way.
constexpr double loose_derivatives = 1e-3;
/// Coordinates may be so many times the depth; then the direction of the point is known to 1e-10.
constexpr double well_conditioned = 1e5;

/// Stops at the first keypoint that could become a match.
template <class Descriptor, class Camera>
struct hopeful_scan {
  const projection_options& options;
  const keyframe_view<Descriptor, Camera>& view;
  const std::uint8_t* taken;
  const float* scale;
  const typename Descriptor::element* descriptor;
  typename Descriptor::distance_type max_distance;
  double u, v, u_right, radius_u, radius_v;
  double variance;  ///< px^2, of the projection in any direction: at least that of a point that is not exact
  int level;
  bool stereo, gated;
  bool hope = false;

  TURBOMAP_HD bool operator()(int keypoint) {
    const int octave = view.octave[keypoint];
    if (level >= 0 && !options.is_candidate(octave, level)) return false;
    if (taken != nullptr && taken[keypoint] != 0) return false;
    const double du = static_cast<double>(view.pixel[keypoint].x) - u;
    const double dv = static_cast<double>(view.pixel[keypoint].y) - v;
    if (du >= radius_u || -du >= radius_u || dv >= radius_v || -dv >= radius_v) return false;
    if (gated && !may_fit(keypoint, du, dv, octave)) return false;
    hope = Descriptor::distance(descriptor, view.descriptor_of(keypoint)) <= max_distance;
    return hope;
  }

  TURBOMAP_HD bool may_fit(int keypoint, double du, double dv, int octave) const {
    double error = du * du + dv * dv, chi2 = options.mono_chi2;
    if (stereo && view.is_stereo(keypoint)) {
      const double dr = static_cast<double>(view.u_right[keypoint]) - u_right;
      error += dr * dr;
      chi2 = options.stereo_chi2;
    }
    const double sigma = static_cast<double>(scale[octave]);
    double most = chi2 * sigma * sigma;
    if (variance > 0) most = chi2 * ((1 + options.stereo_correlation) * sigma * sigma + variance);
    const double root = std::sqrt(most) * (1 + loose) + 2 * loose_pixels;  // shifts of three residuals
    return !(error > root * root);
  }
};

}  // namespace detail

/// For one camera of one target. Points that are not finite may get either answer: they never match.
template <class Descriptor, class Camera>
class projection_prefilter {
 public:
  /// \param search,camera  must outlive this
  TURBOMAP_HD projection_prefilter(const projection_view<Descriptor, Camera>& search, const projection_camera& camera)
      : search_(search),
        view_(search.keyframes[camera.of.target]),
        camera_(view_.cameras[camera.of.camera]),
        index_(camera.of.camera),
        taken_(camera.of.taken),
        widest_(search.options.radius * (search.options.oblique_factor > 1 ? search.options.oblique_factor : 1)),
        centre_{camera.centre.x.value, camera.centre.y.value, camera.centre.z.value},
        t_{camera.T_cw.t.x.value, camera.T_cw.t.y.value, camera.T_cw.t.z.value},
        offset_(std::abs(t_.x) + std::abs(t_.y) + std::abs(t_.z)),
        bf_(camera.bf.value) {
    for (int i = 0; i < 9; ++i) R_.m[i] = camera.T_cw.R.m[i].value;
  }

  /// False: the point certainly has no match.
  TURBOMAP_HD bool may_match(int point) const {
    using detail::loose;
    const projection_options& options = search_.options;
    const vec3<double>& X = search_.points.position[point];
    // Not from the ray: a quaternion that is not quite of unit length is used as it is, and its matrix is no rotation
    // then.
    const double z = R_.m[6] * X.x + R_.m[7] * X.y + R_.m[8] * X.z + t_.z;
    const double size = std::abs(X.x) + std::abs(X.y) + std::abs(X.z) + offset_;
    if (z < -loose * size) return false;
    if (!(size < detail::well_conditioned * z)) return true;
    const vec3<double> ray{X.x - centre_.x, X.y - centre_.y, X.z - centre_.z};
    const double distance = std::sqrt(ray.x * ray.x + ray.y * ray.y + ray.z * ray.z);
    if (options.range_gate) {
      if (distance * (1 + loose) < static_cast<double>(search_.least_distance(point))) return false;
      if (distance * (1 - loose) > static_cast<double>(search_.largest_distance(point))) return false;
    }
    if (options.min_view_cosine > -1) {
      const vec3<float>& n = search_.points.normal[point];
      const double nx = static_cast<double>(n.x), ny = static_cast<double>(n.y), nz = static_cast<double>(n.z);
      const double margin = loose * (1 + std::abs(nx) + std::abs(ny) + std::abs(nz));
      if (ray.x * nx + ray.y * ny + ray.z * nz < (options.min_view_cosine - margin) * distance) return false;
    }
    const vec3<double> X_c{R_.m[0] * X.x + R_.m[1] * X.y + R_.m[2] * X.z + t_.x,
                           R_.m[3] * X.x + R_.m[4] * X.y + R_.m[5] * X.z + t_.y, z};
    vec2<double> p;
    if (!camera_.camera.project(X_c, p)) return true;
    const double m = detail::loose_pixels;
    const image_bounds& b = view_.cells.bounds;
    if (p.x < static_cast<double>(b.min_x) - m || p.x > static_cast<double>(b.max_x) + m ||
        p.y < static_cast<double>(b.min_y) - m || p.y > static_cast<double>(b.max_y) + m)
      return false;
    return may_match_at(point, p, z, level_of(point, distance));
  }

  /// The octave at which a point at `distance` (m, to `loose` relative) should be found; -1: any octave will do, -2: the decision
  /// knows which of two.
  TURBOMAP_HD int level_of(int point, double distance) const {
    const projection_options& options = search_.options;
    if (!options.range_gate) return -1;
    const double wanted = static_cast<double>(search_.points.max_distance[point]);
    const double far = distance * (1 + detail::loose), near = distance * (1 - detail::loose);
    const int top = options.scales.levels - 1;
    int level = 0, most = 0;  // counted to the end: where a search ends cannot be predicted
    for (int o = 0; o < top; ++o) {
      const double s = static_cast<double>(search_.scale[o]);
      level += s * far < wanted ? 1 : 0, most += s * near < wanted ? 1 : 0;
    }
    return level == most ? level : -2;
  }

  /// The rest of the question, of a point in the image that may be in range: whether a keypoint around `p` could be its match.
  /// \param p      its projection, px, to loose_pixels
  /// \param z      its depth, m
  /// \param level  what level_of() says
  TURBOMAP_HD bool may_match_at(int point, const vec2<double>& p, double z, int level) const {
    if (level < -1) return true;
    const projection_options& options = search_.options;
    const double m = detail::loose_pixels;
    const double s = static_cast<double>(search_.scale[options.range_gate ? level : options.window_octave]);
    const double radius = widest_ * s * (1 + detail::loose) + m;
    const double u_right = bf_ > 0 ? p.x - bf_ / z : 0;
    const point_covariance* covariance = search_.covariance_of(point);
    detail::hopeful_scan<Descriptor, Camera> scan{options,
                                                  view_,
                                                  taken_,
                                                  search_.scale,
                                                  search_.descriptor_of(point),
                                                  search_.max_distance,
                                                  p.x,
                                                  p.y,
                                                  u_right,
                                                  radius,
                                                  radius,
                                                  0,
                                                  level,
                                                  bf_ > 0,
                                                  options.is_gated(covariance != nullptr)};
    if (covariance != nullptr && !spread(search_.points.position[point], *covariance, s, scan)) return true;
    visit_window(view_, index_, p.x, p.y, scan.radius_u, scan.radius_v, scan);
    return scan.hope;
  }

 private:
  /// The window of a point that is not exact, and how far off it may be. False: the decision knows.
  TURBOMAP_HD bool spread(const vec3<double>& X, const point_covariance& covariance, double sigma,
                          detail::hopeful_scan<Descriptor, Camera>& scan) const {
    const projection_options& options = search_.options;
    projected_point<double> q;
    if (!project_point(camera_.camera, isometry<double>{R_, t_}, bf_, X, q)) return false;
    const symmetric3<double> C = projected_covariance(to_symmetric<double>(covariance), q.by_X);
    const double more = 1 + detail::loose_derivatives;
    scan.variance = (C.xx + C.yy + C.zz) * more;
    if (!(C.xx >= 0 && C.yy >= 0 && C.zz >= 0)) return false;  // no covariance
    const auto widen = [&](double& radius, double variance) {
      const double wide = options.window_sigmas * std::sqrt(variance + sigma * sigma);
      const double most = (wide < options.max_radius ? wide : options.max_radius) * more + detail::loose_pixels;
      if (most > radius) radius = most;
    };
    if (options.window_sigmas > 0) widen(scan.radius_u, C.xx), widen(scan.radius_v, C.yy);
    return true;
  }

  const projection_view<Descriptor, Camera>& search_;
  const keyframe_view<Descriptor, Camera>& view_;
  const rig_camera<Camera>& camera_;
  int index_;
  const std::uint8_t* taken_;
  double widest_;  ///< px at octave 0
  mat3<double> R_;
  vec3<double> centre_, t_;
  double offset_;
  double bf_;
};

TURBOMAP_END_NAMESPACE
