// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The time per keyframe. Before each piece of work it is asked whether the piece will fit, by what such pieces took before.

#include <array>
#include <chrono>
#include <cstddef>
#include <limits>

namespace turbomap {

/// A clock with a deadline, and expectations of pieces of work, by number. Not a guarantee: a piece that was begun is
/// finished.
template <std::size_t Pieces>
class time_budget {
 public:
  /// Starts the clock. \param deadline_ms  <= 0: none
  void start(double deadline_ms) {
    begin_ = clock::now();
    deadline_ms_ = deadline_ms > 0 ? deadline_ms : std::numeric_limits<double>::infinity();
  }
  /// Since start().
  double elapsed_ms() const { return std::chrono::duration<double, std::milli>(clock::now() - begin_).count(); }
  /// Whether `amount` units of piece `piece` are expected to end in time. A piece never seen is tried if any time is left.
  bool fits(std::size_t piece, double amount = 1) const {
    return elapsed_ms() + expected_ms_[piece] * amount < deadline_ms_;
  }
  /// Until the deadline; infinity where there is none.
  double left_ms() const { return deadline_ms_ - elapsed_ms(); }
  /// How many units fit, at most `wanted`.
  std::size_t fitting(std::size_t piece, std::size_t wanted) const {
    const double left = left_ms();
    if (!(left > 0)) return 0;
    if (!(expected_ms_[piece] > 0)) return wanted;
    const double n = left / expected_ms_[piece];
    return n < static_cast<double>(wanted) ? static_cast<std::size_t>(n) : wanted;
  }
  /// Records what a piece took. Expectations follow at once when a piece takes longer, and slowly when it takes less.
  void record(std::size_t piece, double ms, double amount = 1) {
    if (!(amount > 0)) return;
    double& e = expected_ms_[piece];
    const double unit = ms / amount;
    e = unit > e ? unit : e + forgetting * (unit - e);
  }
  /// A piece was left out: expect a little less, or one slow keyframe would switch it off for ever.
  void left_out(std::size_t piece) { expected_ms_[piece] *= 1 - forgetting; }

 private:
  using clock = std::chrono::steady_clock;
  static constexpr double forgetting = 0.1;  ///< share of a shorter time that goes into the expectation

  clock::time_point begin_ = clock::now();
  double deadline_ms_ = std::numeric_limits<double>::infinity();
  std::array<double, Pieces> expected_ms_{};
};

}  // namespace turbomap
