// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an inertial measurement unit (IMU) gives: samples with their times, and the interval between two frames that is
/// integrated over them. Times are integers (ns), so that long recordings lose no digits.

#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "../span.hpp"
#include "../types.hpp"

namespace turbomap {

/// Angular velocity (rad/s) and specific force (m/s^2: an IMU at rest measures 9.81 upwards) in the body frame.
struct imu_sample {
  vec3<double> gyro;          ///< angular velocity, rad/s
  vec3<double> acceleration;  ///< specific force, m/s^2
};

/// Samples of one IMU in the order of time. Sample i was taken at t_ns[i].
struct imu_samples {
  span<const std::int64_t> t_ns;  ///< times, ns; they increase
  span<const imu_sample> sample;  ///< one per time
};

/// What the sensor measures above the truth: rad/s and m/s^2, in the body frame.
template <class S>
struct imu_bias {
  vec3<S> gyro{S(0), S(0), S(0)};          ///< rad/s
  vec3<S> acceleration{S(0), S(0), S(0)};  ///< m/s^2
};

/// The time from one frame to the next, and the samples that tell what happened in it. Samples first + 1 ... last - 1
/// lie inside. The values at both ends come from the lines through the first two and the last two samples: interpolated
/// where samples `first` and `last` lie outside, extrapolated where they do not, by twice the time between the two at most, beyond
/// which they stay. find_interval() chooses them.
struct imu_interval {
  std::int64_t begin_ns = 0;  ///< time of the first frame
  std::int64_t end_ns = 0;    ///< time of the second frame
  std::int32_t first = 0;     ///< first sample that is used
  std::int32_t last = 0;      ///< last sample that is used
};

namespace plain_detail {

/// s; any two times.
inline double seconds_between(std::int64_t from_ns, std::int64_t to_ns) {
  const bool later = to_ns >= from_ns;  // 64 bits with a sign do not hold the difference of all times
  const std::uint64_t from = static_cast<std::uint64_t>(from_ns), to = static_cast<std::uint64_t>(to_ns);
  const double apart = static_cast<double>(later ? to - from : from - to) * 1e-9;
  return later ? apart : -apart;
}

}  // namespace plain_detail

static_assert(std::is_trivially_copyable_v<imu_sample> && sizeof(imu_sample) == 48);
static_assert(std::is_trivially_copyable_v<imu_interval> && sizeof(imu_interval) == 24);

}  // namespace turbomap
