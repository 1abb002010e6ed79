// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search by projection as its definition reads: every point, every camera, every keypoint, one after the other, in
/// plain double. What the library's search is tested against.

#include <turbomap/fusion/projection_options.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "descriptor_oracle.hpp"
#include "two_views.hpp"
#include "uncertainty_oracle.hpp"

namespace turbomap_test {

/// A trial, and whether it hung on a close call.
template <class Descriptor>
struct oracle_trial {
  turbomap::projection_trial<typename Descriptor::distance_type> trial;
  bool doubtful;
};

/// Keypoints of a camera in the order in which they are looked at: by cell column, cell row and index; those that lie
/// outside of the grid (the last half cell rounds up) are not found at all. Without a grid by index.
template <class Descriptor, class Camera>
std::vector<int> keypoints_by_cell(const turbomap::keyframe_view<Descriptor, Camera>& view, int camera) {
  const auto& grid = view.cells;
  std::vector<std::tuple<float, float, int>> sorted;
  for (int k = 0; k < view.keypoint_count; ++k) {
    if (view.camera_of(k) != camera) continue;
    float column = 0, row = 0;
    if (grid.columns > 0) {
      column = std::round((view.pixel[k].x - grid.bounds.min_x) * grid.inverse_width);
      row = std::round((view.pixel[k].y - grid.bounds.min_y) * grid.inverse_height);
      if (column < 0 || column >= static_cast<float>(grid.columns) || row < 0 || row >= static_cast<float>(grid.rows))
        continue;
    }
    sorted.emplace_back(column, row, k);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> order;
  for (const auto& s : sorted) order.push_back(std::get<2>(s));
  return order;
}

/// One point in one camera, before points that match one keypoint are told apart. `order` is keypoints_by_cell() of the camera.
template <class Descriptor, class Camera>
oracle_trial<Descriptor> oracle_projection(const turbomap::map_point_view<Descriptor>& points, int p,
                                           const turbomap::projection_target<Descriptor, Camera>& target, int camera,
                                           const std::vector<int>& order, const turbomap::projection_options& options) {
  using turbomap::projection_outcome;
  const auto& view = target.view;
  const auto& mounted = view.cameras[camera];
  oracle_trial<Descriptor> result{{projection_outcome::skipped, -1, -1, turbomap::no_match_distance<Descriptor>},
                                  false};
  auto& trial = result.trial;
  const auto ends = [&trial, &result](projection_outcome outcome, const close_calls& calls) {
    trial.outcome = outcome;
    result.doubtful = calls.any;
    return result;
  };
  close_calls calls;
  const auto at =
      static_cast<std::size_t>(camera) * static_cast<std::size_t>(points.count) + static_cast<std::size_t>(p);
  if (!target.skip.empty() && target.skip[at] != 0) return result;

  const Eigen::Vector3d X(points.position[p].x, points.position[p].y, points.position[p].z);
  if (!X.allFinite()) return ends(projection_outcome::behind, calls);
  const Eigen::Matrix3d Sigma = points.covariance == nullptr ? Eigen::Matrix3d::Zero() : to_eigen(points.covariance[p]);
  if (!Sigma.allFinite()) return ends(projection_outcome::behind, calls);
  const oracle_pose mount = to_oracle_pose(mounted.T_camera_body), body = to_oracle_pose(target.T_cw);
  const oracle_pose T = mount * body;
  const Eigen::Vector3d x = T * X;
  const double far = X.norm() + body.t.norm() + mount.t.norm();  // what rounding errors are relative to
  if (!calls.less(0, x.z(), far)) return ends(projection_outcome::behind, calls);

  // A pixel is as uncertain as the direction of the point.
  const double size = 1000 * (1 + 1e-4 * far / x.z());
  Eigen::Vector2d uv;
  if (!oracle_project(mounted.camera, x, uv)) return ends(projection_outcome::outside, calls);
  const auto& b = view.cells.bounds;
  if (!calls.at_most(b.min_x, uv.x(), size) || !calls.less(uv.x(), b.max_x, size) ||
      !calls.at_most(b.min_y, uv.y(), size) || !calls.less(uv.y(), b.max_y, size))
    return ends(projection_outcome::outside, calls);

  const Eigen::Vector3d ray = X - T.inverse().t;
  const double distance = ray.norm();
  if (options.range_gate) {
    const float least = static_cast<float>(options.min_range_factor) * points.min_distance[p];
    const float largest = static_cast<float>(options.max_range_factor) * points.max_distance[p];
    if (!std::isfinite(least) || !std::isfinite(largest)) return ends(projection_outcome::out_of_range, calls);
    if (!calls.at_most(least, distance, far) || !calls.at_most(distance, largest, far))
      return ends(projection_outcome::out_of_range, calls);
  }
  double widened = 1;
  if (options.min_view_cosine > -1 || options.oblique_factor != 1) {
    const Eigen::Vector3d n(points.normal[p].x, points.normal[p].y, points.normal[p].z);
    if (!n.allFinite()) return ends(projection_outcome::oblique, calls);
    const double sum = far * std::max(1.0, n.norm());  // of the terms of ray.dot(n)
    if (options.min_view_cosine > -1 && !calls.at_most(options.min_view_cosine * distance, ray.dot(n), sum))
      return ends(projection_outcome::oblique, calls);
    if (options.oblique_factor != 1 && calls.less(ray.dot(n), options.oblique_cosine * distance, sum))
      widened = options.oblique_factor;
  }

  int level = -1;
  if (options.range_gate)
    for (level = 0; level < options.scales.levels - 1; ++level)
      if (calls.at_most(points.max_distance[p] / distance, oracle_scale(options.scales, level), far / distance)) break;
  trial.level = static_cast<std::int16_t>(level);
  const double radius =
      widened * options.radius * oracle_scale(options.scales, level < 0 ? options.window_octave : level);

  Eigen::Matrix3d K;
  const bool stereo_camera = pinhole_matrix(mounted.camera, K) && mounted.bf > 0;

  // Of a point with a covariance: derivatives are numeric, so comparisons are closer calls.
  const bool uncertain = !Sigma.isZero(0);
  uncertainty_view<Camera> seen{mounted.camera, T, stereo_camera ? mounted.bf : 0.0};
  seen.sigma2 = oracle_sigma2(options.scales, level < 0 ? options.window_octave : level);
  const double numeric = uncertain ? 100 : 1;
  if (uncertain && !seen.differentiable(X)) {  // at the border of the model, or too far away for a difference
    calls.any = true;
    return ends(projection_outcome::outside, calls);
  }
  Eigen::Vector2d window(radius, radius);
  if (uncertain && options.window_sigmas > 0) {
    const Eigen::MatrixXd spread = oracle_spread(seen, X, Sigma);
    calls.any = calls.any || !is_plain_spread(seen, X, Sigma);
    const Eigen::Vector2d deviation(std::sqrt(spread(0, 0)), std::sqrt(spread(1, 1)));
    window = window.cwiseMax((options.window_sigmas * deviation).cwiseMin(options.max_radius));
  }
  using turbomap::projection_gate;
  const bool gated = options.gate == projection_gate::all || (options.gate == projection_gate::uncertain && uncertain);
  bool in_window = false;
  double second = std::numeric_limits<double>::infinity();
  for (const int k : order) {
    const Eigen::Vector2d residual = pixel_of(view, k) - uv;
    if (!calls.less(std::abs(residual.x()), window.x(), size * numeric) ||
        !calls.less(std::abs(residual.y()), window.y(), size * numeric))
      continue;
    in_window = true;
    if (!target.taken.empty() && target.taken[static_cast<std::size_t>(k)] != 0) continue;
    const int above = view.octave[k] - level;
    if (level >= 0 && (above > options.coarser_octaves || -above > options.finer_octaves)) continue;
    const double sigma2 = oracle_sigma2(options.scales, view.octave[k]);
    const bool stereo = stereo_camera && view.is_stereo(k);
    const double right = stereo ? view.u_right[k] - (uv.x() - mounted.bf / x.z()) : 0;
    double chi2 = (residual.squaredNorm() + right * right) / sigma2;
    if (uncertain) {
      seen.bf = stereo ? mounted.bf : 0, seen.sigma2 = sigma2, seen.correlation = options.stereo_correlation;
      Eigen::VectorXd e(seen.size());
      e(0) = residual.x(), e(1) = residual.y();
      if (stereo) e(2) = right;
      calls.any = calls.any || (gated && !is_plain_spread(seen, X, Sigma));
      chi2 = e.dot(oracle_spread(seen, X, Sigma).ldlt().solve(e));
    }
    if (gated && !calls.at_most(chi2, stereo ? options.stereo_chi2 : options.mono_chi2, size * numeric)) continue;
    const auto d = Descriptor::distance(points.descriptor + static_cast<std::size_t>(p) * Descriptor::elements,
                                        view.descriptor_of(k));
    if (!(d <= Descriptor::worst)) continue;  // no distance: matches nothing
    if (trial.keypoint >= 0) second = std::min(second, static_cast<double>(std::max(d, trial.distance)));
    if (trial.keypoint >= 0 && d >= trial.distance) continue;
    trial.keypoint = k;
    trial.distance = d;
  }
  if (!in_window) return ends(projection_outcome::no_keypoint, calls);
  if (trial.keypoint < 0) return ends(projection_outcome::no_consistent_keypoint, calls);
  if (!(static_cast<double>(trial.distance) <= options.max_distance))
    return ends(projection_outcome::too_different, calls);
  const bool clear =
      options.max_ratio == 1 || above_ratio<Descriptor>(trial.distance, options.max_ratio, second, calls) <= 0;
  return ends(clear ? projection_outcome::matched : projection_outcome::ambiguous, calls);
}

/// One keypoint, one point: of the matches of one keypoint the most similar stays, of equal ones the first point.
/// \param trials  of one camera of one target, one per point
template <class Trial>
void settle_oracle(Trial* trials, int points) {
  using turbomap::projection_outcome;
  for (int p = 0; p < points; ++p)
    for (int q = 0; q < points; ++q) {
      const auto &a = trials[p], &b = trials[q];
      const bool plays = b.outcome == projection_outcome::matched || b.outcome == projection_outcome::lost;
      if (p == q || a.outcome != projection_outcome::matched || !plays || a.keypoint != b.keypoint) continue;
      if (b.distance < a.distance || (b.distance == a.distance && q < p)) trials[p].outcome = projection_outcome::lost;
    }
}

/// All trials, [target][camera][point], without options.one_to_one. The views are in host memory.
template <class Descriptor, class Camera>
std::vector<oracle_trial<Descriptor>> projection_oracle(
    const turbomap::map_point_view<Descriptor>& points,
    turbomap::span<const turbomap::projection_target<Descriptor, Camera>> targets,
    const turbomap::projection_options& options) {
  std::vector<oracle_trial<Descriptor>> trials;
  for (const auto& target : targets)
    for (int camera = 0; camera < target.view.camera_count; ++camera) {
      const auto order = keypoints_by_cell(target.view, camera);
      for (int p = 0; p < points.count; ++p)
        trials.push_back(oracle_projection(points, p, target, camera, order, options));
    }
  return trials;
}

}  // namespace turbomap_test
