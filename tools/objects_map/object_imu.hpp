// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What an inertial measurement unit (IMU) told about a keyframe, as systems in the field hold it: behind a mutex of its own, with
/// getters that lock and return copies.

#include <exception>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>

#include <turbomap/inertial/bias_update.hpp>
#include <turbomap/inertial/imu_history.hpp>
#include <turbomap/inertial/imu_samples.hpp>
#include <turbomap/inertial/preintegration.hpp>
#include <turbomap/types.hpp>

namespace turbomap_program {

/// Velocity and biases at a keyframe, and what the IMU measured since the keyframe before in time.
class object_imu {
 public:
  using motion_type = turbomap::preintegration<double>;
  using bias_type = turbomap::imu_bias<double>;
  using lock = std::lock_guard<std::mutex>;

  turbomap::vec3<double> velocity() const { return lock{mutex_}, velocity_; }
  bias_type bias() const { return lock{mutex_}, bias_; }
  std::optional<motion_type> motion() const { return lock{mutex_}, motion_; }

  void set_velocity(const turbomap::vec3<double>& velocity) { lock{mutex_}, velocity_ = velocity; }
  void set_bias(const bias_type& bias) { lock{mutex_}, bias_ = bias; }
  /// The samples stay.
  void set_motion(const motion_type& motion) { lock{mutex_}, motion_ = motion; }
  void set_motion(const motion_type& motion, turbomap::imu_history samples) {
    const lock held(mutex_);
    motion_ = motion, samples_ = std::move(samples);
  }
  void clear_motion() {
    const lock held(mutex_);
    motion_.reset(), samples_ = {};
  }

  /// What the motion was integrated from leaves a keyframe that is about to be erased; empty where it was not kept.
  turbomap::imu_history take_samples() noexcept { return lock{mutex_}, std::move(samples_); }
  /// The samples of the keyframe before come before those of this one. Where they do not fit, or either has none, the motion
  /// can no longer be integrated again.
  void join_samples(turbomap::imu_history before) noexcept {
    const lock held(mutex_);
    if (!motion_) return;
    try {
      if (before.pieces.empty() || samples_.pieces.empty()) throw std::invalid_argument("no samples");
      append(before, samples_);
      samples_ = std::move(before);
    } catch (const std::exception&) {  // no memory, or a hole between the two
      samples_ = {};
    }
  }
  /// The bias before the interval is another now.
  void integrate_again(const bias_type& bias, const turbomap::preintegration_options& options) noexcept {
    const lock held(mutex_);
    if (!motion_ || samples_.pieces.empty() || !turbomap::needs_integration(*motion_, bias, options)) return;
    try {
      motion_ = turbomap::preintegrate(samples_, bias, options);
    } catch (const std::exception&) {  // no memory: corrected to first order, as before
    }
  }

 private:
  mutable std::mutex mutex_;
  turbomap::vec3<double> velocity_{0, 0, 0};
  bias_type bias_;
  std::optional<motion_type> motion_;
  turbomap::imu_history samples_;
};

}  // namespace turbomap_program
