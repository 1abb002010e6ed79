// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Point creation as its definition reads, one match after the other, in plain double.

#include <turbomap/matching/creation_plan.hpp>

#include "two_views.hpp"

namespace turbomap_test {

/// One keypoint of a match.
template <class Camera>
struct oracle_sight {
  oracle_pose T_cw;
  const Camera* camera;
  Eigen::Vector2d pixel;
  Eigen::Vector3d ray;  ///< z = 1 on straight images, else unit
  bool stereo = false;  ///< has u_right; the depth of a rig without rectification does not count
  double u_right = -1, depth = -1, bf = 0;
  double parallax = 2;  ///< cosine of the parallax of the stereo pair; 2: none
  double sigma2, scale;

  bool has_depth() const { return stereo && depth > 0; }
  Eigen::Vector3d stereo_point() const { return T_cw.inverse() * (depth * ray); }
};

template <class Descriptor, class Camera>
oracle_sight<Camera> oracle_look(const turbomap::posed_keyframe<Descriptor, Camera>& keyframe, int keypoint,
                                 const turbomap::pyramid& scales) {
  const auto& view = keyframe.view;
  const auto& camera = view.cameras[view.camera_of(keypoint)];
  oracle_sight<Camera> s;
  s.T_cw = oracle_camera_pose(keyframe, view.camera_of(keypoint));
  s.camera = &camera.camera;
  s.pixel = pixel_of(view, keypoint);
  s.ray = bearing_of(view, keypoint);
  s.scale = oracle_scale(scales, view.octave[keypoint]);
  s.sigma2 = oracle_sigma2(scales, view.octave[keypoint]);
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
  if (!pinhole_matrix(camera.camera, K)) return s;
  s.ray = K.inverse() * s.pixel.homogeneous();
  s.stereo = camera.bf > 0 && view.is_stereo(keypoint);
  if (!s.stereo) return s;
  s.u_right = view.u_right[keypoint];
  s.depth = view.depth == nullptr ? -1 : view.depth[keypoint];
  s.bf = camera.bf;
  if (s.has_depth()) s.parallax = std::cos(2 * std::atan2(s.bf / K(0, 0) / 2, s.depth));
  return s;
}

template <class Camera>
bool oracle_reprojects(const oracle_sight<Camera>& s, const Eigen::Vector3d& x,
                       const turbomap::creation_options& options, close_calls& calls) {
  Eigen::Vector2d seen;
  if (!oracle_project(*s.camera, x, seen)) return false;
  const double error = (seen - s.pixel).squaredNorm();
  if (!s.stereo) return calls.at_most(error, options.mono_chi2 * s.sigma2);
  const double right = seen.x() - s.bf / x.z() - s.u_right;
  return calls.at_most(error + right * right, options.stereo_chi2 * s.sigma2);
}

/// The outcome of one match; sets method and position.
template <class Camera>
turbomap::creation_outcome oracle_outcome(const oracle_sight<Camera>& a, const oracle_sight<Camera>& b,
                                          const turbomap::creation_options& options, turbomap::created_point& p,
                                          close_calls& calls) {
  using outcome = turbomap::creation_outcome;
  using method = turbomap::creation_method;
  const Eigen::Vector3d direction_a = (a.T_cw.R.transpose() * a.ray).normalized();
  const Eigen::Vector3d direction_b = (b.T_cw.R.transpose() * b.ray).normalized();
  const double parallax = direction_a.dot(direction_b);
  const bool enough = a.has_depth() || b.has_depth() || calls.less(parallax, options.max_parallax_cosine, 1);
  Eigen::Vector3d x;
  if (calls.less(parallax, std::min(a.parallax, b.parallax), 1) && calls.less(0, parallax, 1) && enough) {
    p.method = method::triangulated;
    bool shaky = false;
    const bool finite = oracle_triangulate(a.T_cw, a.ray, b.T_cw, b.ray, x, shaky);
    calls.any = calls.any || shaky;
    if (!finite) return outcome::at_infinity;
  } else if (a.has_depth() && a.parallax <= b.parallax) {
    p.method = method::stereo_query;
    x = a.stereo_point();
  } else if (b.has_depth()) {
    p.method = method::stereo_neighbour;
    x = b.stereo_point();
  } else {
    return a.stereo || b.stereo ? outcome::no_depth : outcome::low_parallax;
  }
  p.position = {x.x(), x.y(), x.z()};
  const Eigen::Vector3d x_a = a.T_cw * x, x_b = b.T_cw * x;
  if (!calls.less(0, x_a.z(), x_a.norm())) return outcome::behind_query;
  if (!calls.less(0, x_b.z(), x_b.norm())) return outcome::behind_neighbour;
  if (!oracle_reprojects(a, x_a, options, calls)) return outcome::reprojection_query;
  if (!oracle_reprojects(b, x_b, options, calls)) return outcome::reprojection_neighbour;
  const double distance_a = x_a.norm(), distance_b = x_b.norm();
  if (distance_a == 0 || distance_b == 0) return outcome::zero_distance;
  if (options.max_distance > 0 &&
      (!calls.less(distance_a, options.max_distance) || !calls.less(distance_b, options.max_distance)))
    return outcome::too_far;
  const double distances = distance_b / distance_a, octaves = a.scale / b.scale;
  const double tolerance = options.scale_tolerance * options.scales.scale_factor;
  if (calls.less(distances * tolerance, octaves) || calls.less(octaves * tolerance, distances)) return outcome::scale;
  return outcome::accepted;
}

/// What becomes of each match, in their order. The views are in host memory.
/// \param doubtful  when given: the matches whose outcome hung on a close call, in the same order
template <class Descriptor, class Camera>
std::vector<turbomap::created_point> creation_oracle(
    const turbomap::posed_keyframe<Descriptor, Camera>& query,
    turbomap::span<const turbomap::posed_keyframe<Descriptor, Camera>> neighbours,
    const std::vector<turbomap::correspondence<typename Descriptor::distance_type>>& matches,
    const turbomap::creation_options& options, std::vector<doubtful_result>* doubtful = nullptr) {
  std::vector<turbomap::created_point> points;
  for (const auto& m : matches) {
    turbomap::created_point p{};
    p.neighbour = m.neighbour, p.query = m.query, p.candidate = m.candidate;
    p.method = turbomap::creation_method::none;
    close_calls calls;
    p.outcome = oracle_outcome(
        oracle_look(query, m.query, options.scales),
        oracle_look(neighbours[static_cast<std::size_t>(m.neighbour)], m.candidate, options.scales), options, p, calls);
    points.push_back(p);
    if (calls.any && doubtful != nullptr) doubtful->push_back({m.neighbour, m.query});
  }
  return points;
}

}  // namespace turbomap_test
