// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether local mapping goes on with a keyframe. Other threads may ask it to stop before each stage. A deadline cuts a stage
/// short at a safe point: before a piece of work that is not expected to end in time.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../named_range.hpp"
#include "mapping_report.hpp"
#include "time_budget.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The pieces of work that are begun only if there is time for them.
enum class mapping_piece : std::uint8_t {
  search_neighbour,  ///< the correspondences with one neighbour
  create_points,     ///< all points of one keyframe
  fuse_target,       ///< the keyframe's points in one target
  fuse_back,         ///< the points of all targets in the keyframe
  cull_keyframe,     ///< one candidate
};
/// How many there are.
inline constexpr std::size_t mapping_pieces = static_cast<std::size_t>(mapping_piece::cull_keyframe) + 1;

/// Clock, deadline and requests to stop, of one keyframe after the other. What pieces of work take is learnt from all of them.
class mapping_progress {
 public:
  /// A keyframe begins. \param deadline_ms  <= 0: none
  void start(double deadline_ms) {
    stopped_ = false;
    budget_.start(deadline_ms);
  }
  /// The rest of the keyframe is skipped.
  void stop() { stopped_ = true; }
  /// Since start().
  double elapsed_ms() const { return budget_.elapsed_ms(); }
  /// Until the deadline; infinity where there is none.
  double left_ms() const { return budget_.left_ms(); }

  /// Whether a stage must be left out because others wait. \param hooks  as local_mapper_hooks
  template <class Hooks>
  bool must_skip(mapping_stage s, const Hooks& hooks) {
    const bool waits = s >= mapping_stage::fusion && hooks.keyframes_wait && hooks.keyframes_wait();
    stopped_ = stopped_ || (hooks.stop && hooks.stop());
    return waits || stopped_;
  }
  /// Runs a stage, and reports its time and outcome. \param work  work() is the stage
  template <class Hooks, class Work>
  void run(mapping_stage s, mapping_report& report, const Hooks& hooks, const Work& work) {
    const named_range range(to_string(s));
    const double begin = elapsed_ms();
    cut_ = false;
    work();
    report.outcome[s] = cut_ ? stage_outcome::cut : stage_outcome::done;
    report.cut = report.cut || cut_;
    report.ms[s] += elapsed_ms() - begin;
    if (hooks.stage_done) hooks.stage_done(s, report);
  }

  /// Whether a piece of work is expected to end in time. \param amount  of it, e.g. targets
  bool fits(mapping_piece p, double amount = 1) const { return budget_.fits(number(p), amount); }
  /// How many such pieces fit, at most `wanted`.
  std::size_t fitting(mapping_piece p, std::size_t wanted) const { return budget_.fitting(number(p), wanted); }
  /// Runs a piece of work, and learns what it took.
  template <class Work>
  void timed(mapping_piece p, double amount, const Work& work) {
    const double begin = elapsed_ms();
    work();
    budget_.record(number(p), elapsed_ms() - begin, amount);
  }
  /// The stage that runs ends early.
  void cut() { cut_ = true; }
  /// The same, without a piece of work that did not fit.
  void cut(mapping_piece p) {
    cut();
    budget_.left_out(number(p));
  }

 private:
  static std::size_t number(mapping_piece p) { return static_cast<std::size_t>(p); }

  time_budget<mapping_pieces> budget_;
  bool cut_ = false;      ///< the stage that runs
  bool stopped_ = false;  ///< the keyframe
};

TURBOMAP_END_NAMESPACE
