// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Preintegration while tracking runs: samples are pushed as they come, and every frame asks for the motion since the
/// last keyframe.
///
///     imu_integrator<double> imu(options, bias);
///     imu.restart(keyframe.t);                         // a keyframe
///     imu.push(t, sample);                             // from the driver
///     const auto& moved = imu.advance(frame.t);        // a frame; then predict(state, moved, gravity)
///     frame.history = imu.history();                   // it becomes a keyframe
///     imu.restart(frame.t);

#include <algorithm>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "imu_check.hpp"
#include "imu_history.hpp"
#include "merge.hpp"
#include "preintegrate.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The preintegration from restart() to the last advance(). What throws changes nothing.
template <class S>
class imu_integrator {
 public:
  /// \throws std::invalid_argument  an option or the bias cannot be
  explicit imu_integrator(const preintegration_options& options = {}, const imu_bias<S>& bias = {})
      : options_(options) {
    detail::check_preintegration_options(options);
    detail::check_bias("bias", bias);
    value_.bias = bias_ = bias;
  }

  /// Adds a sample.
  /// \throws std::invalid_argument  its time is not after that of the last one; it is not finite, or saturated
  void push(std::int64_t t_ns, const imu_sample& sample) {
    if (!history_.t_ns.empty()) require(t_ns > history_.t_ns.back(), "t_ns", t_ns, "must be after the sample before");
    detail::check_sample("sample", sample, options_);
    history_.t_ns.push_back(t_ns);
    try {
      history_.sample.push_back(sample);
    } catch (...) {  // out of memory
      history_.t_ns.pop_back();
      throw;
    }
  }

  /// Begins anew at a time (a keyframe): no motion. Forgets the samples that lie before it, but for the last one.
  void restart(std::int64_t t_ns) {
    const auto& t = history_.t_ns;
    const auto after = std::upper_bound(t.begin(), t.end(), t_ns) - t.begin();
    const auto drop = after > 0 ? after - 1 : 0;
    history_.t_ns.erase(history_.t_ns.begin(), history_.t_ns.begin() + drop);
    history_.sample.erase(history_.sample.begin(), history_.sample.begin() + drop);
    history_.pieces.clear();
    now_ns_ = t_ns, started_ = true;
    value_ = {};
    value_.bias = bias_;
  }
  /// For a clock that was set, or a sample of a time that cannot be: forgets all samples, and needs restart() again. The bias stays.
  void clear() {
    history_.t_ns.clear(), history_.sample.clear(), history_.pieces.clear();
    value_ = {};
    value_.bias = bias_;
    started_ = false;
  }

  /// Goes on to a time (a frame) and returns the motion since restart(). O(samples since the last call).
  /// \throws std::invalid_argument  restart() was never called; the time is not after the last one; the samples up to it
  ///                                have a gap, or end too early (preintegration_options)
  const preintegration<S>& advance(std::int64_t t_ns) {
    require(started_, "t_ns", t_ns, "needs restart() first: the interval has no beginning");
    require(t_ns > now_ns_, "t_ns", t_ns, "must be after the time before");
    const imu_interval piece = find_interval(history_.samples(), now_ns_, t_ns);
    const preintegration<S> p = preintegrate(history_.samples(), piece, value_.bias, options_);
    history_.pieces.push_back(piece);
    value_ = detail::append(value_, p);
    now_ns_ = t_ns;
    return value_;
  }

  /// Takes a new estimate of the bias. Where it is far from the old one (preintegration_options), the motion since
  /// restart() is integrated again; otherwise it stays, and corrected() takes it there. Motions from the next restart() on have
  /// it anyway, and this one where there is no motion yet. Returns whether it was integrated again.
  bool set_bias(const imu_bias<S>& bias) {
    detail::check_bias("bias", bias);
    if (history_.pieces.empty()) {
      value_.bias = bias_ = bias;
      return false;
    }
    if (!needs_integration(value_, bias, options_)) return bias_ = bias, false;
    value_ = preintegrate(history_, bias, options_);
    bias_ = bias;
    return true;
  }

  /// The motion from restart() to the last advance().
  const preintegration<S>& value() const { return value_; }
  /// What was integrated, and samples after it: for the keyframe to keep.
  const imu_history& history() const { return history_; }

 private:
  preintegration_options options_;
  imu_history history_;
  preintegration<S> value_;
  imu_bias<S> bias_;  ///< as given last
  std::int64_t now_ns_ = 0;
  bool started_ = false;
};

TURBOMAP_END_NAMESPACE
