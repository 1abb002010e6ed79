// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tells in plain double, in a fraction of the time of the decision itself, that a point certainly has no match.
/// Wherever rounding could matter it says nothing: the plan is the same with and without it.

#include <cmath>

#include "../config.hpp"
#include "projection_test.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Rounding of a few operations, with much to spare.
constexpr double loose = 1e-9;
/// px; a projection in double is nearer than this to the decision's, while it is well conditioned.
constexpr double loose_pixels = 1e-3;
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
  double u, v, u_right, radius, mono_root, stereo_root;
  int level;
  bool stereo;
  bool hope = false;

  TURBOMAP_HD bool operator()(int keypoint) {
    const int octave = view.octave[keypoint];
    if (level >= 0 && !options.is_candidate(octave, level)) return false;
    if (taken != nullptr && taken[keypoint] != 0) return false;
    const double du = static_cast<double>(view.pixel[keypoint].x) - u;
    const double dv = static_cast<double>(view.pixel[keypoint].y) - v;
    if (du >= radius || -du >= radius || dv >= radius || -dv >= radius) return false;
    if (options.gate == projection_gate::all && !may_fit(keypoint, du, dv, octave)) return false;
    hope = Descriptor::distance(descriptor, view.descriptor_of(keypoint)) <= max_distance;
    return hope;
  }

  TURBOMAP_HD bool may_fit(int keypoint, double du, double dv, int octave) const {
    double error = du * du + dv * dv, root = mono_root;
    if (stereo && view.is_stereo(keypoint)) {
      const double dr = static_cast<double>(view.u_right[keypoint]) - u_right;
      error += dr * dr;
      root = stereo_root;
    }
    root = root * static_cast<double>(scale[octave]) * (1 + loose) + 2 * loose_pixels;  // shifts of three residuals
    return !(error > root * root);
  }
};

}  // namespace detail

/// For one camera of one target. Points that are not finite may get either answer: they never match.
template <class Descriptor, class Camera>
class projection_prefilter {
 public:
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
        bf_(camera.bf.value),
        mono_root_(std::sqrt(search.options.mono_chi2)),
        stereo_root_(std::sqrt(search.options.stereo_chi2)) {
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
    return may_match(point, X_c, distance);
  }

 private:
  TURBOMAP_HD bool may_match(int point, const vec3<double>& X_c, double distance) const {
    const projection_options& options = search_.options;
    vec2<double> p;
    if (!camera_.camera.project(X_c, p)) return true;
    const double m = detail::loose_pixels;
    const image_bounds& b = view_.cells.bounds;
    if (p.x < static_cast<double>(b.min_x) - m || p.x > static_cast<double>(b.max_x) + m ||
        p.y < static_cast<double>(b.min_y) - m || p.y > static_cast<double>(b.max_y) + m)
      return false;
    int level = -1;
    if (options.range_gate) {
      const double wanted = static_cast<double>(search_.points.max_distance[point]);
      const int top = options.scales.levels - 1;
      for (level = 0; level < top; ++level)
        if (!(static_cast<double>(search_.scale[level]) * distance * (1 + detail::loose) < wanted)) break;
      // Between two octaves: the decision knows which.
      if (level < top && static_cast<double>(search_.scale[level]) * distance * (1 - detail::loose) < wanted)
        return true;
    }
    const double s = static_cast<double>(search_.scale[options.range_gate ? level : options.window_octave]);
    const double radius = widest_ * s * (1 + detail::loose) + m;
    const double u_right = bf_ > 0 ? p.x - bf_ / X_c.z : 0;
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
                                                  mono_root_,
                                                  stereo_root_,
                                                  level,
                                                  bf_ > 0};
    visit_window(view_, index_, p.x, p.y, radius, scan);
    return scan.hope;
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
  double mono_root_, stereo_root_;
};

TURBOMAP_END_NAMESPACE
