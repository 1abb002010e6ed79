// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A smooth motion through given poses: uniform cumulative cubic B-splines for position (R^3) and rotation (SO(3)),
/// after Lovegrove, Patron-Perez, Sibley (BMVC 2013). Velocity, acceleration and angular velocity are exact
/// derivatives, so simulated inertial data agree with simulated poses.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/error.hpp>
#include <turbomap/io/trajectory.hpp>

namespace turbomap::simulation {

/// The body at one time. All in the world frame, except the angular velocity, which is in the body's (as a gyro has
/// it).
struct body_state {
  Eigen::Quaterniond R_wb;
  Eigen::Vector3d p_wb, velocity, acceleration, angular_velocity;
};

inline Eigen::Quaterniond exp_so3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-9) return Eigen::Quaterniond(1, w.x() / 2, w.y() / 2, w.z() / 2).normalized();
  const Eigen::Vector3d v = w * (std::sin(angle / 2) / angle);
  return {std::cos(angle / 2), v.x(), v.y(), v.z()};
}

inline Eigen::Vector3d log_so3(Eigen::Quaterniond q) {
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  if (sine < 1e-9) return 2 * q.vec();
  return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

/// How many knots `step_ns` apart lie within the times of poses (at least two, times rising). Throws std::invalid_argument,
/// naming `name`, when there are fewer than four, or so many that it can only be a gap: from a first time of 0 to one since
/// 1970, knots would take more than half a terabyte.
inline std::int64_t count_knots(const std::vector<stamped_pose>& poses, std::int64_t step_ns, const std::string& name) {
  require(poses.size() >= 2, name.c_str(), poses.size(), "a motion needs two poses at least");
  constexpr std::uint64_t most = 10000000, longest = std::numeric_limits<std::int64_t>::max();
  // The difference of two signed times may need 64 bits.
  const auto between = [&](std::size_t i, std::size_t j) {
    return static_cast<std::uint64_t>(poses[j].t_ns) - static_cast<std::uint64_t>(poses[i].t_ns);
  };
  const auto seconds = [](std::uint64_t ns) { return std::to_string(ns / 1000000000); };
  const std::uint64_t span_ns = between(0, poses.size() - 1), count = span_ns / static_cast<std::uint64_t>(step_ns) + 1;
  if (count > most || span_ns > longest) {
    std::size_t gap = 1;
    for (std::size_t i = 2; i < poses.size(); ++i)
      if (between(i - 1, i) > between(gap - 1, gap)) gap = i;
    throw std::invalid_argument("turbomap: " + name + ": spans " + seconds(span_ns) + " s, " +
                                seconds(between(gap - 1, gap)) + " s of it between poses " + std::to_string(gap) +
                                " and " + std::to_string(gap + 1) + ": a motion may have " + std::to_string(most) +
                                " knots, " + printed(1e-9 * static_cast<double>(step_ns)) + " s apart");
  }
  require(count >= 4, name.c_str(), static_cast<double>(span_ns) * 1e-9, "seconds must be four knots at least");
  return static_cast<std::int64_t>(count);
}

/// The motion; defined on [begin_ns(), end_ns()].
class motion_spline {
 public:
  /// Knots every `knot_seconds`, at poses interpolated between the given ones (at least two, times rising). Throws
  /// std::invalid_argument when they span fewer than four knots or more than count_knots() allows.
  motion_spline(const std::vector<stamped_pose>& poses, double knot_seconds) {
    require(knot_seconds > 0, "knot_seconds", knot_seconds, "must be positive");
    step_ = static_cast<std::int64_t>(knot_seconds * 1e9);
    const std::int64_t count = count_knots(poses, step_, "poses");
    start_ = poses.front().t_ns;
    std::size_t next = 1;
    for (std::int64_t k = 0; k < count; ++k) {
      const std::int64_t t = start_ + k * step_;
      while (poses[next].t_ns < t && next + 1 < poses.size()) ++next;
      const stamped_pose &a = poses[next - 1], &b = poses[next];
      const double u = static_cast<double>(t - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
      position_.push_back((1 - u) * position(a) + u * position(b));
      rotation_.push_back(rotation(a).slerp(u, rotation(b)).normalized());
    }
  }

  std::int64_t begin_ns() const { return start_ + step_; }
  std::int64_t end_ns() const { return start_ + (static_cast<std::int64_t>(position_.size()) - 2) * step_ - 1; }

  body_state at(std::int64_t t_ns) const {
    require(t_ns >= begin_ns() && t_ns <= end_ns(), "t_ns", t_ns, "must lie within the motion");
    const std::int64_t since = t_ns - start_;
    const auto i = static_cast<std::size_t>(since / step_ - 1);
    const double dt = static_cast<double>(step_) * 1e-9,
                 u = static_cast<double>(since % step_) / static_cast<double>(step_);
    const std::array<double, 3> value{(5 + 3 * u - 3 * u * u + u * u * u) / 6,
                                      (1 + 3 * u + 3 * u * u - 2 * u * u * u) / 6, u * u * u / 6};
    const std::array<double, 3> first{(3 - 6 * u + 3 * u * u) / (6 * dt), (3 + 6 * u - 6 * u * u) / (6 * dt),
                                      3 * u * u / (6 * dt)};
    const std::array<double, 3> second{(u - 1) / (dt * dt), (1 - 2 * u) / (dt * dt), u / (dt * dt)};
    body_state s{rotation_[i], position_[i], Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
    for (std::size_t j = 0; j < 3; ++j) {
      const Eigen::Vector3d dp = position_[i + j + 1] - position_[i + j];
      s.p_wb += value[j] * dp, s.velocity += first[j] * dp, s.acceleration += second[j] * dp;
      const Eigen::Vector3d dr = log_so3(rotation_[i + j].conjugate() * rotation_[i + j + 1]);
      const Eigen::Quaterniond turn = exp_so3(value[j] * dr);
      s.R_wb = s.R_wb * turn;
      s.angular_velocity = turn.conjugate() * s.angular_velocity + first[j] * dr;
    }
    s.R_wb.normalize();
    return s;
  }

 private:
  static Eigen::Vector3d position(const stamped_pose& p) { return {p.T_wb.tx, p.T_wb.ty, p.T_wb.tz}; }
  static Eigen::Quaterniond rotation(const stamped_pose& p) { return {p.T_wb.qw, p.T_wb.qx, p.T_wb.qy, p.T_wb.qz}; }

  std::int64_t start_ = 0, step_ = 0;
  std::vector<Eigen::Vector3d> position_;
  std::vector<Eigen::Quaterniond> rotation_;
};

}  // namespace turbomap::simulation
