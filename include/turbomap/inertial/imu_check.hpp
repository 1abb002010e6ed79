// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which IMU data cannot be integrated: what preintegrate() and imu_integrator refuse, and how an interval finds its
/// samples.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "imu_samples.hpp"
#include "preintegration_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// s: so far apart samples may be that differences of times fit into 64 bits, in ns.
inline constexpr double longest_gap = 1e9;

/// Throws std::invalid_argument where an option is out of range.
inline void check_preintegration_options(const preintegration_options& o) {
  check_not_negative("options.noise.gyro", o.noise.gyro);
  check_not_negative("options.noise.acceleration", o.noise.acceleration);
  check_not_negative("options.noise.gyro_walk", o.noise.gyro_walk);
  check_not_negative("options.noise.acceleration_walk", o.noise.acceleration_walk);
  check_not_negative("options.noise.rate", o.noise.rate);
  require(o.max_gap > 0 && o.max_gap <= longest_gap, "options.max_gap", o.max_gap,
          "must be positive and at most 1e9: times are in ns");
  require(o.max_extrapolation >= 0 && o.max_extrapolation <= longest_gap, "options.max_extrapolation",
          o.max_extrapolation, "must not be negative, and at most 1e9: times are in ns");
  check_not_negative("options.gyro_range", o.gyro_range);
  check_not_negative("options.acceleration_range", o.acceleration_range);
  check_not_negative("options.max_gyro_bias_change", o.max_gyro_bias_change);
  check_not_negative("options.max_acceleration_bias_change", o.max_acceleration_bias_change);
}

/// Throws std::invalid_argument where a vector is not finite, or reaches the full scale of its sensor (0: not known).
inline void check_measurement(const argument_name& sample, const char* member, const vec3<double>& v, double range) {
  const double elements[3] = {v.x, v.y, v.z};
  const char* const axes[3] = {".x", ".y", ".z"};
  for (int i = 0; i < 3; ++i) {
    const auto name = [&] { return (sample + member).append(axes[i]); };
    if (!is_finite(elements[i])) reject(name(), elements[i], "must be finite");
    if (range > 0 && std::abs(elements[i]) >= range)
      reject(name(), elements[i], "is at the end of the sensor's range: saturated");
  }
}

/// Throws std::invalid_argument where one sample cannot be.
inline void check_sample(const argument_name& name, const imu_sample& s, const preintegration_options& o) {
  check_measurement(name, ".gyro", s.gyro, o.gyro_range);
  check_measurement(name, ".acceleration", s.acceleration, o.acceleration_range);
}

/// \param member  of what has the name, such as ".bias"; nothing: the bias itself has it
template <class S>
void check_bias(const argument_name& name, const imu_bias<S>& b, const char* member = "") {
  const auto check = [&](const char* vector, const vec3<S>& v) {
    const S elements[3] = {v.x, v.y, v.z};
    for (const S& x : elements)
      if (!is_finite(x)) reject((name + member).append(vector), x, "must be finite");
  };
  check(".gyro", b.gyro), check(".acceleration", b.acceleration);
}

/// Throws std::invalid_argument where an interval cannot be integrated: its samples are not there, do not increase in
/// time, leave a gap, do not reach its ends, are not finite or saturated. O(samples of the interval).
inline void check_interval(const argument_name& name, const imu_samples& samples, const imu_interval& in,
                           const preintegration_options& o) {
  require(samples.sample.size() == samples.t_ns.size(), "samples.sample.size()", samples.sample.size(),
          "must be that of t_ns");
  if (!(in.end_ns > in.begin_ns)) reject(name + ".end_ns", in.end_ns, "must be after begin_ns");
  if (!(in.first >= 0)) reject(name + ".first", in.first, "must not be negative");
  if (!(in.last > in.first)) reject(name + ".last", in.last, "must be above first: an interval needs two samples");
  if (!(static_cast<std::size_t>(in.last) < samples.t_ns.size())) reject(name + ".last", in.last, "is no sample");
  const auto first = static_cast<std::size_t>(in.first), last = static_cast<std::size_t>(in.last);
  for (std::size_t i = first; i <= last; ++i) {
    check_sample({"samples.sample", i}, samples.sample[i], o);
    if (i == first) continue;
    const std::int64_t before = samples.t_ns[i - 1], t = samples.t_ns[i];
    if (!(t > before)) reject(argument_name("samples.t_ns", i).text(), t, "must be after the sample before");
    if (!(plain_detail::seconds_between(before, t) <= o.max_gap))
      reject(argument_name("samples.t_ns", i).text(), t, "comes more than options.max_gap after the sample before");
  }
  if (!(samples.t_ns[first + 1] > in.begin_ns))
    reject(name + ".first", in.first, "is not the last sample before begin_ns");
  if (!(samples.t_ns[last - 1] < in.end_ns)) reject(name + ".last", in.last, "is not the first sample after end_ns");
  if (!(plain_detail::seconds_between(in.begin_ns, samples.t_ns[first]) <= o.max_extrapolation))
    reject(name + ".begin_ns", in.begin_ns, "is more than options.max_extrapolation before the first sample");
  if (!(plain_detail::seconds_between(samples.t_ns[last], in.end_ns) <= o.max_extrapolation))
    reject(name + ".end_ns", in.end_ns, "is more than options.max_extrapolation after the last sample");
}

}  // namespace detail

/// The samples of the interval from begin_ns to end_ns: from the last one not after its start to the first one not
/// before its end; where there is none such, the first or the last of all. Times of the samples must increase. O(log
/// samples).
/// \throws std::invalid_argument  there are not two samples, or none near the interval
inline imu_interval find_interval(const imu_samples& samples, std::int64_t begin_ns, std::int64_t end_ns) {
  const auto& t = samples.t_ns;
  require(end_ns > begin_ns, "end_ns", end_ns, "must be after begin_ns");
  require(t.size() >= 2, "samples.t_ns.size()", t.size(), "is too small: an interval needs two samples");
  const auto after = std::upper_bound(t.begin(), t.end(), begin_ns) - t.begin();
  const auto end = std::lower_bound(t.begin(), t.end(), end_ns) - t.begin();
  const auto size = static_cast<std::ptrdiff_t>(t.size());
  imu_interval in;
  in.begin_ns = begin_ns, in.end_ns = end_ns;
  in.first = static_cast<std::int32_t>(after > 0 ? after - 1 : 0);
  in.last = static_cast<std::int32_t>(end < size ? end : size - 1);
  require(after < size, "begin_ns", begin_ns, "is after the last sample: there are no samples in the interval");
  require(end > 0, "end_ns", end_ns, "is before the first sample: there are no samples in the interval");
  return in;
}

TURBOMAP_END_NAMESPACE
