// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How results of adjustments are compared with the recorded peer's.

#include <algorithm>
#include <cmath>
#include <vector>

#include <turbomap/math/linear.hpp>
#include <turbomap/math/rotation.hpp>
#include "readers/recording_snapshot_adjustment.hpp"

namespace turbomap_replay {

/// The camera model with parameters in double.
template <class Camera>
struct in_double;
template <template <class> class Camera, class T>
struct in_double<Camera<T>> {
  using type = Camera<double>;
};

/// What both estimates of one keyframe differ by.
struct pose_difference {
  double metres, radians;
};

/// Distance of the camera centres, angle of the rotation between.
inline pose_difference compare_poses(const turbomap::isometry<double>& a, const turbomap::isometry<double>& b) {
  const auto d = a.R * turbomap::transpose(b.R);  // its antisymmetric part is sin(angle) times the axis
  const turbomap::vec3<double> twice{d(2, 1) - d(1, 2), d(0, 2) - d(2, 0), d(1, 0) - d(0, 1)};
  return {turbomap::norm(turbomap::camera_centre(a) - turbomap::camera_centre(b)),
          std::atan2(turbomap::norm(twice) / 2, (d(0, 0) + d(1, 1) + d(2, 2) - 1) / 2)};
}

/// Poses as the peer's solver left them.
inline std::vector<turbomap::isometry<double>> peer_poses(const turbomap::adjustment_snapshot& s) {
  std::vector<turbomap::isometry<double>> poses;
  for (std::size_t i = 0; i < s.keyframe.size(); ++i) {
    poses.push_back(turbomap::to_isometry<double>(s.T_cw_after[i]));
    if (i >= s.optimised) continue;
    std::copy_n(s.pose_after[i].begin(), 9, poses.back().R.m);
    poses.back().t = {s.pose_after[i][9], s.pose_after[i][10], s.pose_after[i][11]};
  }
  return poses;
}

/// NaN where there is one.
inline double largest_of(const std::vector<double>& v) {
  double l = 0;
  for (const double x : v) l = x > l || std::isnan(x) ? x : l;
  return l;
}
inline double mean_of(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x;
  return v.empty() ? 0 : sum / static_cast<double>(v.size());
}

}  // namespace turbomap_replay
