// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Trajectories that need no file: a walk around a room, on and on in the same room, and along a corridor. All have a pose
/// every 0.05 s.

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/io/trajectory.hpp>

#include "motion.hpp"

namespace turbomap::simulation {

/// The pose of a body whose camera is at `centre` and looks `ahead`, upright but for a roll of about `tilt` (radians).
inline stamped_pose body_looking(std::int64_t t_ns, const Eigen::Vector3d& centre, const Eigen::Vector3d& ahead,
                                 double tilt, const Eigen::Isometry3d& T_bc) {
  Eigen::Isometry3d T_wc = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d z = ahead.normalized(), x = z.cross(Eigen::Vector3d(tilt, 0, 1)).normalized();
  T_wc.linear() << x, z.cross(x), z;
  T_wc.translation() = centre;
  const Eigen::Isometry3d T_wb = T_wc * T_bc.inverse();
  const Eigen::Quaterniond q(T_wb.linear());
  const Eigen::Vector3d p = T_wb.translation();
  return {t_ns, {q.x(), q.y(), q.z(), q.w(), p.x(), p.y(), p.z()}};
}

/// A smooth closed walk, 20 s and 2.4 m by 1.8 m a lap, for `seconds`. The camera looks ahead and outward.
/// \param wander  0: each lap is the same. Else path and direction of view change slowly, by about that share of the radius
inline std::vector<stamped_pose> room_walk(double seconds, double wander, const Eigen::Isometry3d& T_bc) {
  std::vector<stamped_pose> poses;
  constexpr double loop = 20;
  for (std::int64_t i = 0; i <= static_cast<std::int64_t>(seconds * 20); ++i) {
    const double t = static_cast<double>(i) / 20, a = two_pi * t / loop;
    // Periods without a common multiple: no lap is like another.
    const double wide = 1 + wander * std::sin(0.618 * a), turned = 2 * wander * std::sin(0.382 * a);
    const double yaw = a + 0.25 * two_pi - 0.9 + 0.5 * std::sin(3 * a) + turned;
    const Eigen::Vector3d centre(wide * 2.4 * std::cos(a), wide * 1.8 * std::sin(a), 1.3 + 0.3 * std::sin(2 * a + 0.4));
    const Eigen::Vector3d ahead(std::cos(yaw), std::sin(yaw), 0.25 * std::sin(2 * a));
    poses.push_back(body_looking(i * 50000000, centre, ahead, 0.1 * std::sin(a), T_bc));
  }
  return poses;
}

/// Straight on at 0.7 m/s, looking ahead with a slow swing: no place is seen twice.
inline std::vector<stamped_pose> corridor_walk(double seconds, const Eigen::Isometry3d& T_bc) {
  std::vector<stamped_pose> poses;
  for (std::int64_t i = 0; i <= static_cast<std::int64_t>(seconds * 20); ++i) {
    const double t = static_cast<double>(i) / 20, yaw = 0.3 * std::sin(0.7 * t);
    const Eigen::Vector3d centre(0.7 * t, 0.2 * std::sin(0.5 * t), 1.3 + 0.05 * std::sin(3 * t));
    const Eigen::Vector3d ahead(std::cos(yaw), std::sin(yaw), 0.05 * std::sin(0.9 * t));
    poses.push_back(body_looking(i * 50000000, centre, ahead, 0, T_bc));
  }
  return poses;
}

/// The room, twice around.
inline std::vector<stamped_pose> builtin_trajectory(const Eigen::Isometry3d& T_bc) { return room_walk(44, 0, T_bc); }

/// 'builtin', 'room' or 'corridor', the last two long enough for so many keyframes (0: the length of 'builtin');
/// any other name is that of a TUM file, and what is wrong with the length of that names it.
inline std::vector<stamped_pose> trajectory(const std::string& name, const motion_options& options,
                                            const Eigen::Isometry3d& T_bc) {
  const double seconds = options.most_keyframes > 0 ? (options.most_keyframes + 4) * options.keyframe_seconds + 1 : 44;
  if (name == "builtin") return builtin_trajectory(T_bc);
  if (name == "room") return room_walk(seconds, 0.15, T_bc);
  if (name == "corridor") return corridor_walk(seconds, T_bc);
  auto poses = read_trajectory(name);
  count_knots(poses, static_cast<std::int64_t>(options.knot_seconds * 1e9), name);
  return poses;
}

}  // namespace turbomap::simulation
