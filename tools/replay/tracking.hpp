// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracking's stand-in: the pose of a new keyframe from the points of the map that it sees.

#include <cstddef>
#include <cstdint>
#include <vector>

#include <turbomap/adjustment/motion_only.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/math/scale_table.hpp>

namespace turbomap_replay {

template <class Map, class Policy>
class pose_tracker {
 public:
  using traits = turbomap::map_traits<Map>;
  using camera = typename traits::camera;

  static constexpr std::size_t fewest = 10;  ///< associations: with fewer the guess stands

  pose_tracker(turbomap::context<Policy>& ctx, const std::vector<turbomap::rig_camera<camera>>& rig,
               const turbomap::pyramid& scales, double stereo_correlation, bool covariances)
      : ctx_(ctx), rig_(rig), adjust_(ctx), covariances_(covariances) {
    options_.stereo_correlation = stereo_correlation;
    turbomap::fill_scales(scales, scale_, sigma2_);
  }

  /// Refines the pose of a keyframe; observations that do not fit are forgotten, as tracking forgets them.
  void operator()(Map& map, typename traits::keyframe k) {
    points_.clear(), pixels_.clear(), information_.clear(), cameras_.clear(), keypoints_.clear();
    covariance_.clear();
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) {
      const auto p = traits::point_at(map, k, i);
      if (p == typename traits::point{}) continue;
      const auto& z = traits::keypoint(map, k, i);
      points_.push_back(traits::position(map, p));
      pixels_.push_back({static_cast<double>(z.x), static_cast<double>(z.y), static_cast<double>(z.u_right)});
      information_.push_back(1 / static_cast<double>(sigma2_[z.octave]));
      cameras_.push_back(z.camera);
      keypoints_.push_back(i);
      if (covariances_) covariance_.push_back(traits::covariance(map, p));
    }
    if (points_.size() < fewest) return;
    const std::int32_t begin[2] = {0, static_cast<std::int32_t>(points_.size())};
    turbomap::motion_only_input<camera> in;
    in.rig = {rig_.data(), static_cast<int>(rig_.size())};
    const auto& T_cw = traits::pose(map, k);
    in.T_cw = {&T_cw, 1};
    in.begin = {begin, 2};
    in.point = points_, in.pixel = pixels_, in.information = information_, in.camera = cameras_;
    in.covariance = covariance_;
    adjust_(ctx_, in, options_, poses_, outliers_);
    if (poses_[0].adjusted == 0) return;
    traits::set_pose(map, k, poses_[0].T_cw);
    for (std::size_t n = 0; n < keypoints_.size(); ++n)
      if (outliers_[n] != 0) turbomap::forget(map, k, keypoints_[n]);
  }

 private:
  turbomap::context<Policy>& ctx_;
  const std::vector<turbomap::rig_camera<camera>>& rig_;
  turbomap::motion_only<camera, Policy> adjust_;
  turbomap::motion_only_options options_;
  bool covariances_;  ///< points are as well known as the map says; false: exactly
  float scale_[turbomap::scale_table_size], sigma2_[turbomap::scale_table_size];
  std::vector<turbomap::vec3<double>> points_, pixels_;
  std::vector<double> information_;
  std::vector<turbomap::point_covariance> covariance_;
  std::vector<std::uint8_t> cameras_, outliers_;
  std::vector<std::size_t> keypoints_;
  std::vector<turbomap::posed_frame> poses_;
};

}  // namespace turbomap_replay
