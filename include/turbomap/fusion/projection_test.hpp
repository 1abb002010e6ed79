// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The decision of the search by projection: one point in one camera, test by test [ORB-SLAM3], in strict<double>, so that
/// every policy and every compiler decides alike.

#include <cstdint>

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../math/functions.hpp"
#include "../math/symmetric3.hpp"
#include "../store/keypoint_window.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The point as it is predicted to be seen.
struct predicted_keypoint {
  vec2<decision> pixel;             ///< projection of the point, px
  decision u_right;                 ///< valid where the camera has bf
  decision radius_u;                ///< px, half the width of the window
  decision radius_v;                ///< px, half its height
  int level;                        ///< -1: any octave will do
  bool uncertain;                   ///< the point has a covariance ...
  symmetric3<decision> covariance;  ///< ... and this is that of its u, v, u_right; px^2
};

/// Looks for the most similar keypoint in the window.
template <class Descriptor, class Camera>
class projection_scan {
 public:
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  /// \param search,camera,predicted  must outlive this   \param point  index into the points of the call
  TURBOMAP_HD projection_scan(const projection_view<Descriptor, Camera>& search, const projection_camera& camera,
                              const predicted_keypoint& predicted, int point)
      : search_(search),
        view_(search.keyframes[camera.of.target]),
        taken_(camera.of.taken),
        predicted_(predicted),
        descriptor_(search.descriptor_of(point)),
        stereo_(camera.bf > decision(0)),
        gated_(search.options.is_gated(predicted.uncertain)) {}

  /// Compares one keypoint. Always false: all keypoints of the window are visited.
  TURBOMAP_HD bool operator()(int keypoint) {
    const vec2<decision> seen = cast<decision>(view_.pixel[keypoint]);
    const decision du = seen.x - predicted_.pixel.x, dv = seen.y - predicted_.pixel.y;
    if (!(abs(du) < predicted_.radius_u) || !(abs(dv) < predicted_.radius_v)) return false;
    in_window = true;
    if (taken_ != nullptr && taken_[keypoint] != 0) return false;
    const int octave = view_.octave[keypoint];
    const projection_options& options = search_.options;
    if (predicted_.level >= 0 && !options.is_candidate(octave, predicted_.level)) return false;
    if (gated_ && !fits(keypoint, du, dv, octave)) return false;
    const distance_type d = Descriptor::distance(descriptor_, view_.descriptor_of(keypoint));
    // The first of equal ones stays; never one that is no number.
    if (best < 0 ? d <= Descriptor::worst : d < distance) {
      if (best >= 0) second = distance;
      best = keypoint;
      distance = d;
    } else if (d < second) {
      second = d;
    }
    return false;
  }

  bool in_window = false;                                  ///< whether any keypoint lay in the window
  std::int32_t best = -1;                                  ///< the most similar keypoint so far; -1: none
  distance_type distance = no_match_distance<Descriptor>;  ///< its distance
  distance_type second = Descriptor::worst;                ///< of another candidate

 private:
  TURBOMAP_HD bool fits(int keypoint, decision du, decision dv, int octave) const {
    const bool stereo = stereo_ && view_.is_stereo(keypoint);
    const decision dr = stereo ? decision(view_.u_right[keypoint]) - predicted_.u_right : decision(0);
    const decision sigma2(search_.sigma2[octave]);
    const decision chi2(stereo ? search_.options.stereo_chi2 : search_.options.mono_chi2);
    if (predicted_.uncertain) {
      const auto L =
          spread_of_difference(predicted_.covariance, stereo, sigma2, decision(search_.options.stereo_correlation));
      return squared_norm(solve_lower(L, vec3<decision>{du, dv, dr})) <= chi2;
    }
    decision error = du * du + dv * dv;
    if (stereo) error += dr * dr;
    return error <= chi2 * sigma2;
  }

  const projection_view<Descriptor, Camera>& search_;
  const keyframe_view<Descriptor, Camera>& view_;
  const std::uint8_t* taken_;
  const predicted_keypoint& predicted_;
  const typename Descriptor::element* descriptor_;
  bool stereo_, gated_;
};

/// Octave at which a point at `distance` should be found: the least k with max_distance / distance <= s^k, clamped to
/// the pyramid.
TURBOMAP_HD inline int predicted_octave(decision max_distance, decision distance, const float* scale, int levels) {
  const decision ratio = max_distance / distance;
  int level = 0;
  while (level < levels - 1 && decision(scale[level]) < ratio) ++level;
  return level;
}

/// One point in one camera, from projection to the most similar keypoint.
template <class Descriptor, class Camera>
struct projection_test {
  using trial_type = projection_trial<typename Descriptor::distance_type>;  ///< what became of the point
  const projection_view<Descriptor, Camera>& search;                        ///< the search
  const projection_camera& camera;                                          ///< in which the point is looked for

  /// Decides for one point. O(keypoints in the window).
  TURBOMAP_HD trial_type operator()(int point) const {
    trial_type trial{projection_outcome::skipped, -1, -1, no_match_distance<Descriptor>};
    if (camera.of.skip != nullptr && camera.of.skip[point] != 0) return trial;
    predicted_keypoint predicted;
    if (!predict(point, predicted, trial.outcome)) return trial;
    trial.level = static_cast<std::int16_t>(predicted.level);
    projection_scan<Descriptor, Camera> scan(search, camera, predicted, point);
    visit_window(search.keyframes[camera.of.target], camera.of.camera, predicted.pixel.x.value, predicted.pixel.y.value,
                 predicted.radius_u.value, predicted.radius_v.value, scan);
    trial.keypoint = scan.best;
    trial.distance = scan.distance;
    trial.outcome = outcome_of(scan);
    return trial;
  }

 private:
  TURBOMAP_HD projection_outcome outcome_of(const projection_scan<Descriptor, Camera>& scan) const {
    if (scan.best < 0)
      return scan.in_window ? projection_outcome::no_consistent_keypoint : projection_outcome::no_keypoint;
    if (!(scan.distance <= search.max_distance)) return projection_outcome::too_different;
    const double ratio = detail::ratio_of<Descriptor>(search.options.max_ratio);
    if (ratio < 1 && decision(scan.distance) > decision(ratio) * decision(scan.second))
      return projection_outcome::ambiguous;
    return projection_outcome::matched;
  }

  /// False, with the outcome, where the point cannot be seen. Bits tell what is not finite: -ffast-math assumes it
  /// away.
  TURBOMAP_HD bool predict(int point, predicted_keypoint& predicted, projection_outcome& outcome) const {
    const projection_options& options = search.options;
    const vec3<double>& position = search.points.position[point];
    const vec3<decision> X = cast<decision>(position), X_c = camera.T_cw * X;
    outcome = projection_outcome::behind;
    const point_covariance* covariance = search.covariance_of(point);
    if (!finite(position) || (covariance != nullptr && !finite(*covariance))) return false;
    if (!(X_c.z > decision(0))) return false;

    outcome = projection_outcome::outside;
    const auto& view = search.keyframes[camera.of.target];
    if (!view.cameras[camera.of.camera].camera.project(X_c, predicted.pixel)) return false;
    const image_bounds& b = view.cells.bounds;
    const decision u = predicted.pixel.x, v = predicted.pixel.y;
    if (!(u >= decision(b.min_x) && u < decision(b.max_x) && v >= decision(b.min_y) && v < decision(b.max_y)))
      return false;

    outcome = projection_outcome::out_of_range;
    const vec3<decision> ray = X - camera.centre;
    const decision distance = norm(ray);
    if (options.range_gate) {
      const float least = search.least_distance(point), largest = search.largest_distance(point);
      if (!detail::is_finite(least) || !detail::is_finite(largest)) return false;
      if (!(distance >= decision(least) && distance <= decision(largest))) return false;
    }

    outcome = projection_outcome::oblique;
    bool frontal = true;
    if (options.reads_normals()) {
      const vec3<float>& normal = search.points.normal[point];
      if (!finite(normal)) return false;
      const decision along = dot(ray, cast<decision>(normal));
      if (options.min_view_cosine > -1 && !(along >= decision(options.min_view_cosine) * distance)) return false;
      frontal = along >= decision(options.oblique_cosine) * distance;
    }

    predicted.level = options.range_gate ? predicted_octave(decision(search.points.max_distance[point]), distance,
                                                            search.scale, options.scales.levels)
                                         : -1;
    const int window_octave = options.range_gate ? predicted.level : options.window_octave;
    decision radius = decision(options.radius) * decision(search.scale[window_octave]);
    if (!frontal) radius = radius * decision(options.oblique_factor);
    predicted.radius_u = predicted.radius_v = radius;
    predicted.u_right = camera.bf > decision(0) ? u - camera.bf / X_c.z : decision(0);
    predicted.uncertain = covariance != nullptr;
    outcome = projection_outcome::outside;
    return covariance == nullptr || spread(X, *covariance, decision(search.sigma2[window_octave]), predicted);
  }

  /// The same of a point that is not exact: where it may be seen, and the window that holds that.
  TURBOMAP_HD bool spread(const vec3<decision>& X, const point_covariance& covariance, decision sigma2,
                          predicted_keypoint& predicted) const {
    const projection_options& options = search.options;
    projected_point<decision> p;
    if (!project_point(search.keyframes[camera.of.target].cameras[camera.of.camera].camera, camera.T_cw, camera.bf, X,
                       p))
      return false;
    predicted.covariance = projected_covariance(to_symmetric<decision>(covariance), p.by_X);
    const auto widen = [&](decision& radius, decision variance) {
      const decision sum = variance + sigma2, most(options.max_radius);
      decision wide = decision(options.window_sigmas) * sqrt(sum > sigma2 ? sum : sigma2);
      if (wide > most) wide = most;
      if (wide > radius) radius = wide;
    };
    if (options.window_sigmas > 0) {
      widen(predicted.radius_u, predicted.covariance.xx);
      widen(predicted.radius_v, predicted.covariance.yy);
    }
    return true;
  }

  TURBOMAP_HD static bool finite(const point_covariance& c) {
    return finite(vec3<float>{c.xx, c.yx, c.yy}) && finite(vec3<float>{c.zx, c.zy, c.zz});
  }
  template <class T>
  TURBOMAP_HD static bool finite(const vec3<T>& a) {
    return detail::is_finite(a.x) && detail::is_finite(a.y) && detail::is_finite(a.z);
  }
};

TURBOMAP_END_NAMESPACE
