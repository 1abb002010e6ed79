// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the body goes: keyframes picked along a motion, the drift of the estimated poses.

#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/io/recording_data.hpp>
#include "motion_spline.hpp"
#include "random.hpp"

namespace turbomap::simulation {

inline constexpr double two_pi = 6.28318530717958647692;

struct motion_options {
  double knot_seconds = 0.1;
  double frame_seconds = 0.05;    ///< between images
  double keyframe_seconds = 0.5;  ///< a keyframe is due after so long ...
  double keyframe_metres = 0.35;  ///< ... or so far ...
  double keyframe_radians = 0.4;  ///< ... or such a turn
  /// Without stereo, keyframes are due after this share of metres and radians: [ORB-SLAM3] asks for 0.9 of the reference
  /// keyframe's points instead of 0.75, because all new points need a second view.
  double monocular_share = 0.6;
  /// Without stereo, the second keyframe is so far from the first: two views without parallax make no first map. 3 degrees
  /// at 3 m.
  double first_metres = 0.15;
  int most_keyframes = 0;                 ///< 0: all the way
  double drift_metres_per_metre = 1e-3;   ///< standard deviation of the position's random walk, per metre travelled
  double drift_radians_per_metre = 2e-4;  ///< of the rotation's
};

inline Eigen::Isometry3d pose_of(const body_state& s) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = s.R_wb.toRotationMatrix(), T.translation() = s.p_wb;
  return T;
}

struct timed_body {
  std::int64_t t_ns;
  body_state body;
  std::int32_t frame = 0;  ///< its number among the images
};

/// All images' times and bodies, and which of them become keyframes (as numbers of images).
struct planned_motion {
  std::vector<timed_body> frames;
  std::vector<std::size_t> keyframes;
};

/// \param monocular  the first map needs two views with parallax: until they are found, the first keyframe waits for a
///                   second one that is far enough away and not turned away, and is replaced by what turned away
inline planned_motion plan_motion(const motion_spline& motion, const motion_options& options, bool monocular = false) {
  planned_motion plan;
  const double share = monocular ? options.monocular_share : 1;
  const double metres = share * options.keyframe_metres, radians = share * options.keyframe_radians;
  const auto step = static_cast<std::int64_t>(options.frame_seconds * 1e9);
  for (std::int64_t t = motion.begin_ns(); t <= motion.end_ns(); t += step) {
    plan.frames.push_back({t, motion.at(t), static_cast<std::int32_t>(plan.frames.size())});
    const timed_body& now = plan.frames.back();
    bool due = plan.keyframes.empty();
    if (!due) {
      const timed_body& last = plan.frames[plan.keyframes.back()];
      const double moved = (now.body.p_wb - last.body.p_wb).norm();
      const bool turned = now.body.R_wb.angularDistance(last.body.R_wb) >= radians;
      due = static_cast<double>(t - last.t_ns) * 1e-9 >= options.keyframe_seconds - 1e-9 || moved >= metres || turned;
      if (monocular && plan.keyframes.size() == 1) {
        due = moved >= options.first_metres;
        if (turned && !due) plan.keyframes.clear(), due = true;
      }
    }
    if (due) plan.keyframes.push_back(plan.frames.size() - 1);
    if (options.most_keyframes > 0 && plan.keyframes.size() == static_cast<std::size_t>(options.most_keyframes)) break;
  }
  return plan;
}

/// The body poses that a system with this drift would estimate: exact relative motions, each off by a random step that
/// grows with the distance travelled since the last keyframe. The first pose is exact.
inline std::vector<Eigen::Isometry3d> drifting_poses(const std::vector<Eigen::Isometry3d>& T_wb,
                                                     const motion_options& options, std::uint64_t seed) {
  std::vector<Eigen::Isometry3d> drifting{T_wb.front()};
  for (std::size_t i = 1; i < T_wb.size(); ++i) {
    random_stream random(seed, purpose::drift, i);
    const Eigen::Isometry3d step = T_wb[i - 1].inverse() * T_wb[i];
    const double metres = step.translation().norm();
    const auto noise = [&](double sigma) {
      return Eigen::Vector3d(sigma * random.normal(), sigma * random.normal(), sigma * random.normal());
    };
    Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
    error.translation() = noise(metres * options.drift_metres_per_metre);
    error.linear() = exp_so3(noise(metres * options.drift_radians_per_metre)).toRotationMatrix();
    drifting.push_back(drifting.back() * step * error);
    drifting.back().linear() = Eigen::Quaterniond(drifting.back().linear()).normalized().toRotationMatrix();
  }
  return drifting;
}

}  // namespace turbomap::simulation
