// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// When a keyframe is redundant: most of its points are seen by enough other keyframes, at the same scale or a finer one
/// [TurboMap §IV-F], [ORB-SLAM3]. A point that counts its observers per octave answers that by a short sum.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../span.hpp"

namespace turbomap {

/// Options of keyframe culling. Defaults are those of [ORB-SLAM3] for stereo without an inertial unit.
struct keyframe_culling_options {
  float redundant_share =
      0.9F;              ///< redundant: more than this share of its points (0.5 stereo-inertial); product in float
  int observers = 3;     ///< a point is redundant when more than so many other keyframes see it...
  int octave_slack = 1;  ///< ...at an octave no coarser than its own plus this
  float max_depth = 0;   ///< m, > 0 (stereo): only points with a depth in [0, max_depth] count; 0: all (monocular)
  /// Of the stage, per keyframe that is mapped, so that a crowded map, or mapping that was behind, costs no more than this. 0: no
  /// bound [ORB-SLAM3]. The recordings have at most 4 removals.
  int most_candidates = 128;     ///< so many are looked at, those that share most
  int most_erased = 8;           ///< after so many removals the others wait for the next keyframe
  int fewest_measurements = 2;   ///< a point dies when a removal leaves it so many measurements or fewer
  bool temporal_guards = false;  ///< inertial: the rules below; the map's traits have time(), previous() and next()
  int keep_keyframes = 21;       ///< none is taken while there are so many or fewer
  int keep_last = 2;             ///< the current keyframe and so many before it, by their place in time, stay
  double max_gap = 0.5;          ///< s between the neighbours in time that a removal leaves side by side
  double max_old_gap = 3;  ///< s, the same for keyframes before the keep_keyframes-th predecessor, once initialised
  /// The IMU is initialised: max_old_gap holds.
  bool inertial_initialised = true;
};

/// Keyframes that have to see a point, the one that is looked at among them: it does at the finest octave of its cameras, so never
/// coarser than the view that is looked at.
inline std::uint32_t observers_with_own(const keyframe_culling_options& options) {
  return static_cast<std::uint32_t>(options.observers) + 2;
}

/// The points of a keyframe that count, and those of them that enough others see as well.
struct redundancy {
  int points = 0;     ///< that count
  int redundant = 0;  ///< of those
};

/// redundant > share * points, the product in float: what the recorded peer computes.
inline bool is_redundant(const redundancy& count, const keyframe_culling_options& options) {
  const float limit = options.redundant_share * static_cast<float>(count.points);
  return static_cast<float>(count.redundant) > limit;
}

/// Keyframes that see a point at `octave` or finer, but no more than `enough`: counting ends there.
/// \param counts  observers of the point per octave, finest first
inline std::uint32_t count_up_to(span<const std::uint32_t> counts, int octave, std::uint32_t enough) {
  const std::size_t wanted = static_cast<std::size_t>(octave) + 1;
  const std::size_t end = counts.size() < wanted ? counts.size() : wanted;
  std::uint32_t sum = 0;
  std::size_t o = 0;  // four at a time: where a loop ends that depends on an octave is hard to predict
  for (; o + 4 <= end && sum < enough; o += 4) sum += counts[o] + counts[o + 1] + counts[o + 2] + counts[o + 3];
  if (sum >= enough) return sum;
  for (; o < end; ++o) sum += counts[o];
  return sum;
}

/// Coarser than any octave with its slack, which are bytes.
inline constexpr std::uint16_t beyond_octaves = 1024;
/// The finest octave up to which `enough` keyframes see a point; beyond_octaves where all of them are fewer.
/// \param counts  observers of the point per octave, finest first
inline std::uint16_t enough_from(span<const std::uint32_t> counts, std::uint32_t enough) {
  std::uint32_t sum = 0;
  std::uint16_t octave = 0;  // a sum of flags: where a loop ends that depends on counts is hard to predict
  for (const std::uint32_t count : counts) {
    sum += count;
    octave = static_cast<std::uint16_t>(octave + (sum < enough ? 1 : 0));
  }
  return sum < enough ? beyond_octaves : octave;
}

/// Throws std::invalid_argument naming the option that is out of range.
inline void check(const keyframe_culling_options& o) {
  require(o.redundant_share >= 0 && o.redundant_share <= 1, "options.redundant_share", o.redundant_share,
          "must be in [0, 1]");
  require(o.observers >= 0, "options.observers", o.observers, "must not be negative");
  require(o.octave_slack >= 0 && o.octave_slack <= 255, "options.octave_slack", o.octave_slack,
          "must be in [0, 255]: octaves are bytes");
  require(o.max_depth >= 0, "options.max_depth", o.max_depth, "must not be negative");
  require(o.most_candidates >= 0, "options.most_candidates", o.most_candidates, "must not be negative");
  require(o.most_erased >= 0, "options.most_erased", o.most_erased, "must not be negative");
  require(o.keep_keyframes >= 0, "options.keep_keyframes", o.keep_keyframes, "must not be negative");
  require(o.keep_last >= 0, "options.keep_last", o.keep_last, "must not be negative");
  require(o.max_gap >= 0, "options.max_gap", o.max_gap, "must not be negative");
  require(o.max_old_gap >= 0, "options.max_old_gap", o.max_old_gap, "must not be negative");
}

}  // namespace turbomap
