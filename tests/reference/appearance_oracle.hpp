// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The update of map points as its definition reads: one point after the other, all distances, sorted, in plain double.

#include <turbomap/appearance/appearance_view.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "two_views.hpp"
#include "uncertainty_oracle.hpp"

namespace turbomap_test {

/// The median of values: element floor((n - 1) / 2) in ascending order.
inline double oracle_median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[(values.size() - 1) / 2];
}

/// The descriptor with the least median distance to all, itself included with distance 0; the first of equals. What is
/// not finite is farther than everything else.
template <class Descriptor>
int oracle_medoid(const std::vector<const typename Descriptor::element*>& descriptors) {
  int medoid = -1;
  double least = 0;
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::vector<double> distances;
    for (std::size_t j = 0; j < descriptors.size(); ++j) {
      const auto d = static_cast<double>(i == j ? 0 : Descriptor::distance(descriptors[i], descriptors[j]));
      distances.push_back(std::isfinite(d) ? d : std::numeric_limits<double>::infinity());
    }
    const double median = oracle_median(distances);
    if (medoid >= 0 && !(median < least)) continue;
    medoid = static_cast<int>(i);
    least = median;
  }
  return medoid;
}

template <class Descriptor, class Camera>
Eigen::Vector3d oracle_centre(const turbomap::posed_keyframe<Descriptor, Camera>& keyframe, int camera) {
  return oracle_camera_pose(keyframe, camera).inverse().t;
}

/// The views of one point.
template <class Descriptor, class Camera>
std::vector<uncertainty_view<Camera>> oracle_views(
    const turbomap::appearance_view& view, int point,
    const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
    const turbomap::appearance_options& options) {
  std::vector<uncertainty_view<Camera>> views;
  for (int o = view.observation_offset[point]; o < view.observation_offset[point + 1]; ++o) {
    const auto [k, keypoint] = view.observations[o];
    const auto& keyframe = keyframes[static_cast<std::size_t>(k)];
    const int camera = keyframe.view.camera_of(keypoint);
    const auto& c = keyframe.view.cameras[camera];
    views.push_back({c.camera, oracle_camera_pose(keyframe, camera), keyframe.view.is_stereo(keypoint) ? c.bf : 0,
                     oracle_sigma2(options.scales, keyframe.view.octave[keypoint]), options.stereo_correlation});
  }
  return views;
}
/// How well the point is known. NaN where a numeric derivative leaves the camera model, or is too near to one of the cameras.
template <class Descriptor, class Camera>
turbomap::point_covariance oracle_covariance(const turbomap::appearance_view& view, int point,
                                             const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
                                             const turbomap::appearance_options& options) {
  const Eigen::Vector3d X(view.position[point].x, view.position[point].y, view.position[point].z);
  const auto views = oracle_views(view, point, keyframes, options);
  for (const auto& v : views)
    if (std::abs((v.T_cw * X).z()) < 0.2 || (v(X).size() == 0) != (v(1.01 * X).size() == 0) ||
        (v(X).size() == 0) != (v(0.99 * X).size() == 0))
      return {std::numeric_limits<float>::quiet_NaN()};
  const Eigen::Matrix3f C = oracle_point_covariance(views, X).template cast<float>();
  return {C(0, 0), C(1, 0), C(1, 1), C(2, 0), C(2, 1), C(2, 2)};
}

/// Every point of the call. The views are in host memory.
template <class Descriptor, class Camera>
std::vector<turbomap::point_appearance> appearance_oracle(
    const turbomap::appearance_view& view, const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
    const turbomap::appearance_options& options) {
  std::vector<turbomap::point_appearance> points;
  for (int i = 0; i < view.count; ++i) {
    turbomap::point_appearance p{};
    p.medoid = -1;
    points.push_back(p);
    const std::vector<turbomap::point_observation> seen(view.observations + view.observation_offset[i],
                                                        view.observations + view.observation_offset[i + 1]);
    if (seen.empty()) continue;
    std::vector<turbomap::point_observation> chosen;  // at equal steps, where there are too many
    std::vector<int> number;
    const auto n = static_cast<int>(seen.size());
    const int take = options.most_views == 0 || options.most_views > n ? n : options.most_views;
    for (int j = 0; j < take; ++j) {
      number.push_back(static_cast<int>(std::floor(static_cast<double>(j) * n / take)));
      chosen.push_back(seen[static_cast<std::size_t>(number.back())]);
    }
    if (options.descriptors) {
      std::vector<const typename Descriptor::element*> descriptors;
      for (const auto& o : chosen)
        descriptors.push_back(keyframes[static_cast<std::size_t>(o.keyframe)].view.descriptor_of(o.keypoint));
      points.back().medoid = number[static_cast<std::size_t>(oracle_medoid<Descriptor>(descriptors))];
    }
    if (!options.geometry) continue;
    if (options.covariance) points.back().covariance = oracle_covariance(view, i, keyframes, options);
    const Eigen::Vector3d x(view.position[i].x, view.position[i].y, view.position[i].z);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int in_reference = -1;  // the keypoint that says the octave
    for (const auto& o : chosen) {
      const auto& keyframe = keyframes[static_cast<std::size_t>(o.keyframe)];
      const Eigen::Vector3d ray = x - oracle_centre(keyframe, keyframe.view.camera_of(o.keypoint));
      if (ray.norm() > 0) sum += ray / ray.norm();
    }
    for (const auto& o : seen)
      if (o.keyframe == view.reference[i] && in_reference < 0) in_reference = o.keypoint;
    const auto& reference = keyframes[static_cast<std::size_t>(view.reference[i])];
    for (auto o = seen.rbegin(); o != seen.rend(); ++o)
      if (o->keyframe == view.reference[i] && reference.view.camera_of(o->keypoint) == 0) in_reference = o->keypoint;
    sum /= static_cast<double>(chosen.size());
    points.back().normal = {static_cast<float>(sum.x()), static_cast<float>(sum.y()), static_cast<float>(sum.z())};
    const double most =
        (x - oracle_centre(reference, 0)).norm() * oracle_scale(options.scales, reference.view.octave[in_reference]);
    points.back().max_distance = static_cast<float>(most);
    points.back().min_distance = static_cast<float>(most / oracle_scale(options.scales, options.scales.levels - 1));
  }
  return points;
}

}  // namespace turbomap_test
