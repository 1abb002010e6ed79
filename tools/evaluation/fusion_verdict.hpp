// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the evaluation of fusion on a recorded map is asked, and what it answers.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <turbomap/mapping/duplicate_fusion.hpp>
#include <vector>

namespace turbomap::evaluation {

struct fusion_evaluation_options {
  double max_distance = 75;  ///< of 384 bits: the default's share of 256, 50
  double sigma_px = 1;       ///< of a keypoint: widens window and gate alike
  merge_rule merges = merge_rule::refuse;

  fusion_options fusion() const {
    fusion_options o;
    o.search.scales.levels = 1;  // the detector's scale is constant
    o.search.range_gate = false;
    o.search.max_distance = max_distance;
    o.search.radius *= sigma_px;
    o.search.mono_chi2 *= sigma_px * sigma_px;
    o.commit.merges = merges;
    return o;
  }
};

/// What a map became, by the books of the source.
struct fusion_verdict {
  fusion_summary summary;
  std::size_t faults = 0;      ///< of validate()
  std::size_t seen_twice = 0;  ///< points with two observations by one keyframe, counted apart from validate()
  std::size_t confirmed = 0;   ///< pairs of the source that are one point now
  std::size_t observations_before = 0, observations_after = 0;
  /// Pairs of landmarks in one point that the source sees at two keypoints of one keyframe: how far apart those are, px.
  std::vector<double> contradiction_px;
  std::size_t contradictions_known = 0;  ///< those of which the map was told both observations
  /// Landmarks that went into another one's point: how far the survivor projects from their keypoints (median of the views), and
  /// how far they did themselves. `certain`: those of pairs that the source confirms.
  std::vector<double> survivor_px, certain_survivor_px, own_px;

  /// What the description of the data calls a duplicate: within so many pixels of a keypoint of the other one.
  static constexpr double duplicate_px = 8;
  std::size_t observations_lost() const {
    return observations_before + summary.observations_added - observations_after;
  }
  static std::size_t near(const std::vector<double>& px) {
    return static_cast<std::size_t>(std::count_if(px.begin(), px.end(), [](double d) { return d <= duplicate_px; }));
  }
};

/// Why the withheld landmark of a pair was found at its keypoint or not: the first that applies.
enum class pair_cause : std::uint8_t {
  unseen,     ///< no other keyframe sees it: no descriptor to know it by
  turned,     ///< behind, outside or oblique
  misplaced,  ///< it projects too far from its keypoint for the gate
  unlike,     ///< its descriptor is farther than max_distance from that of its keypoint
  lost,       ///< another keypoint in the gate is nearer in descriptor
  found
};
inline constexpr std::size_t pair_causes = 6;

struct pair_evaluation {
  std::size_t pairs = 0;
  std::array<std::size_t, pair_causes> cause{};
  std::array<std::size_t, 10> outcome{};  ///< of those that were searched, by duplicate_outcome
  std::size_t elsewhere = 0;              ///< of the matched: at another keypoint
  std::vector<double> error_px;           ///< landmark to its keypoint
  std::vector<double> distance;           ///< descriptor to that of its keypoint
  fusion_verdict verdict;

  std::size_t of(pair_cause c) const { return cause[static_cast<std::size_t>(c)]; }
  std::size_t of(duplicate_outcome o) const { return outcome[static_cast<std::size_t>(o)]; }
};

}  // namespace turbomap::evaluation
