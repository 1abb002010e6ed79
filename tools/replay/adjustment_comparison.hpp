// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How results of adjustments are compared with the recorded peer's.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/timing_table.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/math/rotation.hpp>
#include "bundle/solve.hpp"
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

/// What adjustments took, ours and the peer's.
class adjustment_times {
 public:
  explicit adjustment_times(const std::filesystem::path& directory) {
    const auto timing = turbomap::read_timing(directory);
    if (!timing.empty() && timing.has("ms_lba"))
      peer_iteration_ = timing.column("iter"), peer_ms_ = timing.column("ms_lba");
  }

  /// \param ours  a turbomap_bundle::solution
  template <class Solution>
  void add(std::int32_t iteration, const Solution& ours) {
    ms_.push_back(ours.ms_setup + ours.ms_adjust), cpu_ms_.push_back(ours.cpu_ms_setup + ours.cpu_ms_adjust);
    for (std::size_t row = 0; row < peer_iteration_.size(); ++row)
      if (peer_iteration_[row] == iteration) peer_at_.push_back(peer_ms_[row]);
  }
  /// The peer's only where it is known of each adjustment.
  void add_json(nlohmann::json& json) const {
    using turbomap_bundle::median;
    json["ms_median"] = median(ms_), json["ms_mean"] = mean_of(ms_), json["cpu_ms_mean"] = mean_of(cpu_ms_);
    if (peer_at_.size() == ms_.size())
      json["peer_ms_median"] = median(peer_at_), json["peer_ms_mean"] = mean_of(peer_at_);
  }

 private:
  std::vector<double> ms_, cpu_ms_, peer_iteration_, peer_ms_, peer_at_;
};

}  // namespace turbomap_replay
