// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping does with a keyframe, stage by stage: names, switches, times, and results. Plain data.

#include <array>
#include <cstddef>
#include <cstdint>

#include "../map/map_fault.hpp"
#include "../matching/creation_plan.hpp"
#include "../plain_vector.hpp"
#include "fusion_options.hpp"
#include "guard_times.hpp"
#include "local_adjustment_options.hpp"

namespace turbomap {

/// The stages, in the order in which they run [TurboMap Fig. 3].
enum class mapping_stage : std::uint8_t {
  process,           ///< the appearance of the points that tracking associated
  point_culling,     ///< new points on probation
  search,            ///< correspondences with the neighbours
  creation,          ///< points of them, and their commit
  fusion,            ///< duplicates, both ways
  adjustment,        ///< of poses and points around the keyframe
  keyframe_culling,  ///< redundant keyframes
};
inline constexpr std::size_t mapping_stages = 7;  ///< how many there are.

/// Names of the command-line contract.
inline const char* to_string(mapping_stage stage) {
  constexpr const char* names[mapping_stages] = {"process", "point_culling", "search",          "creation",
                                                 "fusion",  "adjustment",    "keyframe_culling"};
  return names[static_cast<std::size_t>(stage)];
}

/// What happened to a stage.
enum class stage_outcome : std::uint8_t {
  off,      ///< switched off
  done,     ///< ran to its end
  skipped,  ///< left out: more keyframes wait, or a stop was asked for
  cut,      ///< left out, or ended early at a safe point: the deadline
  refused   ///< left out: the keyframe has no pose that can be used, see mapping_report::refused
};

/// As in docs/local_mapping.md.
inline const char* to_string(stage_outcome outcome) {
  constexpr const char* names[] = {"off", "done", "skipped", "cut", "refused"};
  return names[static_cast<std::size_t>(outcome)];
}

/// One value per stage.
template <class T>
struct per_stage {
  /// In the order of mapping_stage.
  std::array<T, mapping_stages> values{};
  /// The value of a stage.
  T& operator[](mapping_stage s) { return values[static_cast<std::size_t>(s)]; }
  /// The value of a stage.
  const T& operator[](mapping_stage s) const { return values[static_cast<std::size_t>(s)]; }
};

/// One iteration of local mapping.
struct mapping_report {
  per_stage<double> ms;              ///< wall time, locks included; `process` with all before it, as a mirror's reading
  per_stage<stage_outcome> outcome;  ///< what happened to each stage.
  per_stage<guard_times> held;       ///< the map's guard
  double total_ms = 0;               ///< of process(), locks included.
  std::size_t neighbours = 0;        ///< searched for correspondences
  std::size_t matches = 0;           ///< correspondences found
  creation_summary creation;         ///< what points were made of
  std::size_t points_created = 0;    ///< new points in the map.
  std::size_t points_culled = 0;     ///< on probation
  std::size_t fusion_targets = 0;    ///< keyframes that the last round searched for duplicates.
  fusion_summary fused;              ///< what fusion did, in all rounds together.
  /// Of the mapper's own stage; as it comes where a hook adjusts. `outliers` and `points_erased` of all rounds together,
  /// everything else of the last one (local_mapper_options::extra_rounds).
  local_adjustment_summary adjustment;
  std::size_t points_updated = 0;                ///< whose appearance was computed anew
  plain_vector<std::uint64_t> keyframes_culled;  ///< ids
  fault_list refused;                            ///< what was passed over because it cannot be used; each fault once
  /// Points and keyframes of the mirror that the sample check found out of date, and read anew. Points that miss nothing but views of
  /// keyframes which have not been read, as those that still wait for their turn, are read anew and not counted.
  std::size_t healed = 0;
  bool cut = false;  ///< the deadline cut a stage
};

}  // namespace turbomap
