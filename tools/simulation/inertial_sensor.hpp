// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an IMU measures along a motion: the exact angular velocity and specific force of the spline, a bias that starts
/// somewhere and walks, and white noise.

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include <turbomap/inertial/imu_samples.hpp>
#include "motion_spline.hpp"
#include "random.hpp"
#include "rig.hpp"

namespace turbomap::simulation {

inline constexpr double gravity = 9.81;  ///< m/s^2, along -z of the world

/// Samples with their times, and the true bias of each.
struct imu_record {
  std::vector<std::int64_t> t_ns;
  std::vector<imu_sample> samples;
  std::vector<std::array<double, 6>> bias;  ///< gyro (rad/s), acceleration (m/s^2)
};

/// Samples from `begin` to `end` at the sensor's rate.
inline imu_record simulate_imu(const motion_spline& motion, std::int64_t begin, std::int64_t end,
                               const imu_noise& noise, std::uint64_t seed) {
  imu_record record;
  random_stream random(seed, purpose::imu), start(seed, purpose::imu, 1);
  const double white = std::sqrt(noise.rate_hz), walk = 1 / white;
  std::array<double, 6> bias;
  for (std::size_t a = 0; a < 6; ++a) bias[a] = (a < 3 ? noise.gyro_bias : noise.acceleration_bias) * start.normal();
  const auto step = static_cast<std::int64_t>(1e9 / noise.rate_hz);
  for (std::int64_t t = begin; t <= end; t += step) {
    const body_state s = motion.at(t);
    const Eigen::Vector3d force = s.R_wb.conjugate() * (s.acceleration + Eigen::Vector3d(0, 0, gravity));
    std::array<double, 6> v;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      v[a] = s.angular_velocity[axis] + bias[a] + noise.gyro * white * random.normal();
      v[a + 3] = force[axis] + bias[a + 3] + noise.acceleration * white * random.normal();
    }
    record.t_ns.push_back(t);
    record.samples.push_back({{v[0], v[1], v[2]}, {v[3], v[4], v[5]}});
    record.bias.push_back(bias);
    for (std::size_t a = 0; a < 3; ++a) {
      bias[a] += noise.gyro_walk * walk * random.normal();
      bias[a + 3] += noise.acceleration_walk * walk * random.normal();
    }
  }
  return record;
}

}  // namespace turbomap::simulation
