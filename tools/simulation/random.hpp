// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random numbers that are the same on every machine: splitmix64 (Steele, Lea, Flood, 2014), and distributions made of
/// integer arithmetic only. The standard library's distributions differ between implementations.

#include <cstdint>
#include <initializer_list>

namespace turbomap::simulation {

/// What a stream is for: streams of different purposes are independent, so that adding draws to one changes no other.
enum class purpose : std::uint64_t {
  scene_boxes = 1,
  scene_points,
  point_descriptor,
  point_detail,
  centroid,
  observation,
  clutter,
  tracking,
  drift,
  imu,
  perturbation
};

/// A stream of numbers named by seed, purpose and up to three indices, e.g. (seed, observation, keyframe, camera,
/// point).
class random_stream {
 public:
  random_stream(std::uint64_t seed, purpose what, std::uint64_t a = 0, std::uint64_t b = 0, std::uint64_t c = 0) {
    state_ = seed;
    for (const std::uint64_t part : {static_cast<std::uint64_t>(what), a, b, c})
      state_ = next() ^ (part * 0xD6E8FEB86659FD93u);
  }

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  /// In [0, 1), all 53 bits random.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// True with this probability.
  bool chance(double probability) { return uniform() < probability; }
  /// In [0, count), count > 0.
  std::uint64_t below(std::uint64_t count) {
    return static_cast<std::uint64_t>(uniform() * static_cast<double>(count));
  }
  /// Mean 0, variance 1: the sum of twelve uniform numbers of 21 bits (never beyond +-6, no transcendental function).
  double normal() {
    std::uint64_t sum = 0;
    for (int i = 0; i < 4; ++i) {
      const std::uint64_t bits = next();
      sum += (bits & 0x1FFFFF) + ((bits >> 21) & 0x1FFFFF) + ((bits >> 42) & 0x1FFFFF);
    }
    return (static_cast<double>(sum) + 6.0) * 0x1p-21 - 6.0;
  }

 private:
  std::uint64_t state_;
};

}  // namespace turbomap::simulation
