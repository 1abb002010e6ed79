// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options of the stage that finds and fuses duplicate points, and what it tells, as plain data.

#include <cstddef>
#include <cstdint>

#include "../fusion/duplicate_options.hpp"
#include "../map/merge_rule.hpp"

namespace turbomap {

/// When searches see what commits did.
enum class fusion_mode : std::uint8_t {
  snapshot,  ///< one search and one commit per pass
  serial_exact  ///< camera by camera, target by target: each search sees the commit before it, and survivors of merges have
                ///< their new descriptors at once [ORB-SLAM3]. Many small calls: for comparisons
};

/// Options of a commit of duplicates.
struct fusion_commit_options {
  /// Of points that one camera sees at two keypoints.
  merge_rule merges = merge_rule::refuse_apart;
  merge_tolerance tolerance;  ///< of merge_rule::refuse_apart
  /// The stage applies so many entries of its plan while it holds the guard once, so that others may enter in between; each
  /// such part is checked as a whole before its first entry. Chosen for less than 1 ms on one core of 2025; 0: the whole plan at once.
  int entries_per_guard = 24;
};

/// Options of duplicate_fusion.
struct fusion_options {
  fusion_mode mode = fusion_mode::snapshot;  ///< when searches see what commits did
  duplicate_options search;                  ///< what a duplicate is
  fusion_commit_options commit;              ///< what is done with one
  /// The gate allows for how badly a point is known: as the map keeps it, or, where its traits have no covariances, by the
  /// pixels that show the point. False: all points are exact [ORB-SLAM3].
  bool covariances = false;
  /// Of those pixels: of the errors of u and u_right. local_mapper takes that of its adjustment.
  double stereo_correlation = 0;
};

/// The counts of one or more commits.
struct fusion_summary {
  std::size_t entries = 0;             ///< duplicates that were found, but for those that contradict the map
  std::size_t observations_added = 0;  ///< their keypoint had no point
  std::size_t merged = 0;              ///< their keypoint had another point: one is left of the two
  std::size_t stale = 0;               ///< point or keyframe had left the map
  std::size_t already_observed = 0;    ///< the camera sees the point at a keypoint
  std::size_t conflicts = 0;           ///< merges that fusion_commit_options::merges refused

  /// The sums.
  fusion_summary& operator+=(const fusion_summary& o) {
    entries += o.entries, observations_added += o.observations_added, merged += o.merged;
    stale += o.stale, already_observed += o.already_observed, conflicts += o.conflicts;
    return *this;
  }
};

}  // namespace turbomap
