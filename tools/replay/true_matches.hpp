// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How many matches of a search are right: by the simulator's point ids where there are any, else by ground truth poses (the
/// two rays meet) and by a third view (the point they meet in is seen there, with a similar descriptor).

#include <cmath>
#include <cstdint>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/matching/epipolar.hpp>
#include "readers/recording_snapshot.hpp"

#include "recorded_keyframes.hpp"

namespace turbomap_replay {

/// Counts of judged matches.
struct truth_counts {
  std::size_t matches = 0;
  std::size_t epipolar = 0;    ///< rays meet under ground truth poses: within 2.5 standard deviations in both images
  std::size_t third_view = 0;  ///< and another keyframe of the snapshot shows the point
  truth_counts& operator+=(const truth_counts& o) {
    matches += o.matches, epipolar += o.epipolar, third_view += o.third_view;
    return *this;
  }
  nlohmann::json json() const {
    return {{"pairs", matches}, {"epipolar_true", epipolar}, {"third_view_confirms", third_view}};
  }
};

/// Judges matches of the search of one snapshot by ground truth.
template <class Camera>
class true_matches {
 public:
  true_matches(const turbomap::recording& recording, const std::vector<turbomap::rig_camera<Camera>>& rig,
               const turbomap::recording_snapshot& snapshot)
      : recording_(recording), rig_(rig), snapshot_(snapshot) {}

  /// \param rows  recorded row of each neighbour of the plan
  template <class Plan>
  truth_counts judge(const Plan& plan, const std::vector<std::size_t>& rows) const {
    truth_counts counts;
    for (const auto& m : plan) {
      ++counts.matches;
      const auto a = static_cast<std::size_t>(snapshot_.keyframe);
      const auto b = static_cast<std::size_t>(snapshot_.search.neighbours[rows[static_cast<std::size_t>(m.neighbour)]]);
      turbomap::vec3<double> X;
      if (!meet(a, m.query, b, m.candidate, X)) continue;
      ++counts.epipolar;
      counts.third_view += third_view(a, m.query, b, X) ? 1 : 0;
    }
    return counts;
  }

 private:
  static constexpr double deviations = 2.5;
  static constexpr int similar = 50;  ///< descriptor distance

  std::size_t row(std::size_t keyframe, std::int32_t keypoint) const {
    return static_cast<std::size_t>(recording_.kp_off[keyframe]) + static_cast<std::size_t>(keypoint);
  }
  int camera(std::size_t keyframe, std::int32_t keypoint) const {
    return recording_.nleft[keyframe] >= 0 && keypoint >= recording_.nleft[keyframe] ? 1 : 0;
  }
  turbomap::isometry<double> pose(std::size_t keyframe, int camera) const {
    return turbomap::to_isometry<double>(rig_[static_cast<std::size_t>(camera)].T_camera_body) *
           true_pose(recording_, keyframe);
  }
  double sigma(std::size_t row) const { return std::pow(recording_.meta.scale_factor, recording_.kp_octave[row]); }

  /// Reprojects within the tolerance of the keypoint.
  bool shows(std::size_t keyframe, std::int32_t keypoint, const turbomap::vec3<double>& X) const {
    const int c = camera(keyframe, keypoint);
    const std::size_t r = row(keyframe, keypoint);
    const auto X_c = pose(keyframe, c) * X;
    turbomap::vec2<double> p;
    if (!(X_c.z > 0) || !rig_[static_cast<std::size_t>(c)].camera.project(X_c, p)) return false;
    return std::hypot(p.x - recording_.kp_xy[r].x, p.y - recording_.kp_xy[r].y) <= deviations * sigma(r);
  }

  bool meet(std::size_t a, std::int32_t keypoint_a, std::size_t b, std::int32_t keypoint_b,
            turbomap::vec3<double>& X) const {
    const int ca = camera(a, keypoint_a), cb = camera(b, keypoint_b);
    turbomap::vec3<double> ray_a, ray_b;
    const auto pixel = [&](std::size_t r) { return turbomap::cast<double>(recording_.kp_xy[r]); };
    if (!rig_[static_cast<std::size_t>(ca)].camera.unproject(pixel(row(a, keypoint_a)), ray_a) ||
        !rig_[static_cast<std::size_t>(cb)].camera.unproject(pixel(row(b, keypoint_b)), ray_b))
      return false;
    return turbomap::triangulate(pose(a, ca), ray_a, pose(b, cb), ray_b, X) && shows(a, keypoint_a, X) &&
           shows(b, keypoint_b, X);
  }

  bool third_view(std::size_t a, std::int32_t keypoint, std::size_t b, const turbomap::vec3<double>& X) const {
    const auto& descriptor = recording_.kp_desc[row(a, keypoint)];
    for (const std::int32_t other : snapshot_.search.neighbours) {
      const auto k = static_cast<std::size_t>(other);
      if (k == a || k == b) continue;
      const auto count = static_cast<std::int32_t>(recording_.keypoints(k).size());
      // Both projections once; keypoints are then a plain scan.
      for (std::size_t c = 0; c < rig_.size(); ++c) {
        const auto X_c = pose(k, static_cast<int>(c)) * X;
        turbomap::vec2<double> p;
        if (!(X_c.z > 0) || !rig_[c].camera.project(X_c, p)) continue;
        for (std::int32_t i = 0; i < count; ++i) {
          const std::size_t r = row(k, i);
          if (camera(k, i) != static_cast<int>(c)) continue;
          const double tolerance = deviations * sigma(r);
          if (std::abs(recording_.kp_xy[r].x - p.x) <= tolerance &&
              std::abs(recording_.kp_xy[r].y - p.y) <= tolerance &&
              orb::distance(descriptor.data(), recording_.kp_desc[r].data()) <= similar)
            return true;
        }
      }
    }
    return false;
  }

  const turbomap::recording& recording_;
  const std::vector<turbomap::rig_camera<Camera>>& rig_;
  const turbomap::recording_snapshot& snapshot_;
};

}  // namespace turbomap_replay
