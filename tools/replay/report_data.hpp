// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the report of a replay shows, as plain data: whoever ran the replay fills it in, write_report (report.hpp)
/// makes the page. What is not known stays as it is here, a NaN, a negative count or an empty vector, and the page
/// leaves it out.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <turbomap/types.hpp>

namespace turbomap_replay {

inline constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

/// One line of the table of stages; milliseconds per keyframe.
struct report_stage {
  std::string name;  ///< of the contract: process, point_culling, search, ...
  double ms_mean = not_known, ms_median = not_known, ms_p95 = not_known, ms_max = not_known;
  double peer_ms_mean = not_known;
};

/// One iteration of local mapping, i.e. one keyframe handled. Vectors have one element per stage of
/// report_data::stages, or none.
struct report_row {
  double time_s = not_known;          ///< of the keyframe, from any moment
  std::vector<double> stage_ms;       ///< NaN: the stage did not run
  std::vector<double> peer_stage_ms;  ///< the recorded system's, same keyframe and stage
  std::vector<std::uint8_t> skipped;  ///< 1: left out because more keyframes waited
  std::vector<std::uint8_t> cut;      ///< 1: ended early by its deadline
  double total_ms = not_known;        ///< NaN: the sum of stage_ms
  std::int64_t points = -1;           ///< in the map, after the iteration
  std::int64_t keyframes = -1;        ///< in the map, after the iteration
  std::int64_t observations = -1;     ///< in the map, after the iteration
  std::int64_t points_created = -1;   ///< in this iteration, as all that follow
  std::int64_t points_culled = -1;
  std::int64_t merged = -1;              ///< duplicates fused into another point
  std::int64_t observations_added = -1;  ///< by fusion, without a merge
  std::int64_t keyframes_culled = -1;
};

/// Where a keyframe stood: the camera centre in the map's frame, m.
struct report_keyframe {
  turbomap::vec3<double> centre{not_known, not_known, not_known};
  bool alive = true;  ///< false: culled; the centre is then the last one it had
};

/// A moment to mark in the plots, e.g. when an inertial system aligned its world.
struct report_event {
  std::size_t row = 0;
  std::string label;
};

/// Everything on the page. Positions are in the frame of the map, in metres.
struct report_data {
  std::string recording, policy, machine;
  std::vector<std::pair<std::string, std::string>> facts;  ///< more of the head: name, value
  std::vector<std::string> notes;                          ///< sentences under the table of stages
  std::string peer = "peer";                               ///< what the recorded system is called

  std::int64_t keyframes = -1, keyframes_left = -1, map_points = -1, skipped = -1;
  double ate_rmse_m = not_known, peer_ate_rmse_m = not_known;

  std::vector<report_stage> stages;  ///< in the order in which they run, without the total
  report_stage total{"total"};
  std::size_t warm_up = 0;  ///< so many first rows are not in the figures of the stages
  std::vector<report_row> rows;
  std::vector<report_event> events;

  std::vector<turbomap::vec3<double>> points;
  std::vector<std::int32_t> point_observations;      ///< keyframes that see the point; as many as points, or none
  std::vector<report_keyframe> trajectory;           ///< one per row, in their order; or none
  std::vector<turbomap::vec3<double>> ground_truth;  ///< camera centres, aligned with the map by the caller; NaN: a gap
  std::vector<turbomap::vec3<double>> peer_trajectory;  ///< its final one, aligned with the map by the caller
  turbomap::vec3<double> up{0, -1, 0};  ///< against gravity, in the frame of the map (v of a level camera points down)
};

}  // namespace turbomap_replay
