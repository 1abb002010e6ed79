// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The samples of the time between two keyframes, kept so that they can be integrated again when the estimate of the
/// bias has moved far.

#include <cstdint>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "imu_samples.hpp"
#include "merge.hpp"
#include "preintegrate.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Pieces of time one after the other without a hole, e.g. from frame to frame, with their samples.
struct imu_history {
  std::vector<std::int64_t> t_ns;    ///< times of the samples, ns
  std::vector<imu_sample> sample;    ///< one per time
  std::vector<imu_interval> pieces;  ///< of time, each beginning where the one before ends

  /// Views of times and samples; valid until the history is changed.
  imu_samples samples() const { return {t_ns, sample}; }
};

/// Appends what happened from the end of `history` on: of the keyframe after one that is culled.
/// \throws std::invalid_argument  `later` does not begin where `history` ends. Nothing is changed
inline void append(imu_history& history, const imu_history& later) {
  if (later.pieces.empty()) return;
  if (history.pieces.empty()) {
    history = later;
    return;
  }
  require(later.pieces.front().begin_ns == history.pieces.back().end_ns, "later.pieces[0].begin_ns",
          later.pieces.front().begin_ns, "must be the end of the history");
  imu_history joined = history;
  const auto offset = static_cast<std::int32_t>(joined.t_ns.size());
  joined.t_ns.insert(joined.t_ns.end(), later.t_ns.begin(), later.t_ns.end());
  joined.sample.insert(joined.sample.end(), later.sample.begin(), later.sample.end());
  for (imu_interval piece : later.pieces) {
    piece.first += offset, piece.last += offset;
    joined.pieces.push_back(piece);
  }
  history = std::move(joined);
}

/// Integrates a history at a bias: its pieces, merged. O(samples).
/// \throws std::invalid_argument  as preintegrate()
template <class S>
preintegration<S> preintegrate(const imu_history& history, const imu_bias<S>& bias,
                               const preintegration_options& options) {
  preintegration<S> p;
  p.bias = bias;
  for (const imu_interval& piece : history.pieces) p = merge(p, preintegrate(history.samples(), piece, bias, options));
  return p;
}

TURBOMAP_END_NAMESPACE
