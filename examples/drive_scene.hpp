// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The types of example 04, as a user's system has them, and a simulated drive: a car with a camera, a satellite
/// receiver and wheels goes round a bend between houses.

#include <cmath>
#include <cstddef>
#include <random>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/math/rotation.hpp>
#include <turbomap/types.hpp>
#include <vector>

namespace my {

struct Vector {
  double x, y, z;
};
/// World to camera, as this system keeps it.
struct Pose {
  double w, x, y, z;
  Vector t;
};
struct Keypoint {
  int frame, point;
  float u, v;
};
struct Drive {
  std::vector<Pose> poses;
  std::vector<Vector> points;
  std::vector<Keypoint> keypoints;
  std::vector<Vector> receiver;  // where each frame was
  std::vector<Vector> wheels;    // from each frame but the last: the way to the next, in its own axes
};

constexpr turbomap::pinhole<double> camera{500, 500, 320, 240};
constexpr double keypoint_sigma = 1, receiver_sigma = 0.5, wheel_sigma = 0.01;  // px, m, m

inline turbomap::rigid_transform<double> T_cw_of(const Pose& p) { return {p.x, p.y, p.z, p.w, p.t.x, p.t.y, p.t.z}; }
inline Pose pose_of(const turbomap::rigid_transform<double>& T) { return {T.qw, T.qx, T.qy, T.qz, {T.tx, T.ty, T.tz}}; }

}  // namespace my

namespace example {

/// The truth, and what the system knows: measurements with noise, one keypoint of fifty far off, and a bad guess.
class drive_scene {
 public:
  drive_scene() {
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int f = 0; f < 30; ++f) {
      const double yaw = 0.02 * f, x = 25 * (1 - std::cos(yaw)), z = 50 * std::sin(yaw);
      const turbomap::rigid_transform<double> turn{0, -std::sin(yaw / 2), 0, std::cos(yaw / 2), 0, 0, 0};
      const auto t = turbomap::to_isometry<double>(turn) * turbomap::vec3<double>{-x, 0, -z};
      truth_.poses.push_back({turn.qw, turn.qx, turn.qy, turn.qz, {t.x, t.y, t.z}});
      for (int i = 0; i < 20; ++i) {
        const double side = i % 2 == 0 ? 5 : -5;
        truth_.points.push_back(
            {x + side + uniform(random_), -1 + 2 * uniform(random_), z + 10 + 4 * uniform(random_)});
      }
    }
  }

  my::Drive measure() {
    my::Drive drive;
    for (std::size_t f = 0; f < truth_.poses.size(); ++f) {
      see(f, drive);
      drive.receiver.push_back(noisy(centre(truth_, f), my::receiver_sigma));
      if (f + 1 == truth_.poses.size()) break;
      const auto T_cw = turbomap::to_isometry<double>(my::T_cw_of(truth_.poses[f]));
      drive.wheels.push_back(noisy(T_cw * centre(truth_, f + 1), my::wheel_sigma));
    }
    for (const auto& p : truth_.poses) {  // off by a degree and a metre
      double step[6];
      for (int i = 0; i < 6; ++i) step[i] = (i < 3 ? 0.02 : 1) * normal_(random_);
      drive.poses.push_back(my::pose_of(turbomap::left_exp(step, my::T_cw_of(p))));
    }
    for (const auto& x : truth_.points) drive.points.push_back(noisy({x.x, x.y, x.z}, 0.5));
    return drive;
  }

  /// Mean distance of the camera to where it truly was, m.
  double error(const my::Drive& drive) const {
    double sum = 0;
    for (std::size_t f = 0; f < drive.poses.size(); ++f) sum += turbomap::norm(centre(drive, f) - centre(truth_, f));
    return sum / static_cast<double>(drive.poses.size());
  }

 private:
  static turbomap::vec3<double> centre(const my::Drive& drive, std::size_t f) {
    return turbomap::camera_centre(turbomap::to_isometry<double>(my::T_cw_of(drive.poses[f])));
  }
  my::Vector noisy(const turbomap::vec3<double>& x, double sigma) {
    return {x.x + sigma * normal_(random_), x.y + sigma * normal_(random_), x.z + sigma * normal_(random_)};
  }
  void see(std::size_t f, my::Drive& drive) {
    const auto T_cw = turbomap::to_isometry<double>(my::T_cw_of(truth_.poses[f]));
    for (std::size_t l = 0; l < truth_.points.size(); ++l) {
      const my::Vector& p = truth_.points[l];
      const auto x = T_cw * turbomap::vec3<double>{p.x, p.y, p.z};
      turbomap::vec2<double> pixel{};
      if (x.z < 3 || x.z > 30 || !my::camera.project(x, pixel)) continue;
      if (pixel.x < 0 || pixel.x >= 640 || pixel.y < 0 || pixel.y >= 480) continue;
      const my::Vector seen = noisy({pixel.x, pixel.y, 0}, random_() % 50 == 0 ? 30 : my::keypoint_sigma);
      drive.keypoints.push_back(
          {static_cast<int>(f), static_cast<int>(l), static_cast<float>(seen.x), static_cast<float>(seen.y)});
    }
  }

  my::Drive truth_;  ///< poses and points alone
  std::mt19937 random_{4};
  std::normal_distribution<double> normal_;
};

}  // namespace example
