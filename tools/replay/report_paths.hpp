// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The paths that a report shows beside the map's own: ground truth and the recorded system's final trajectory, each
/// brought into the frame of the map by one rigid alignment, as the ATE does.

#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <turbomap/io/recording_data.hpp>
#include <turbomap/io/trajectory_error.hpp>
#include <turbomap/math/linear.hpp>

#include "report_data.hpp"

namespace turbomap_replay {

/// Fills in ground_truth, peer_trajectory and up from the recording, for a trajectory that is there already (one
/// keyframe a keyframe of the recording). Only keyframes that are alive, with finite centres, count for the alignment;
/// with fewer than three of them nothing is changed. Up is +z of the ground truth's world, as EuRoC and TUM-VI have it.
inline void add_recorded_paths(const turbomap::recording& recording, report_data& data) {
  using vec3 = turbomap::vec3<double>;
  turbomap::require(data.trajectory.size() == recording.keyframe_count(), "report_data.trajectory.size()",
                    data.trajectory.size(), "must be the number of the recording's keyframes");
  const auto aligned = [&](auto centre_of) {
    std::vector<vec3> from, to;
    for (std::size_t i = 0; i < data.trajectory.size(); ++i) {
      const auto& own = data.trajectory[i];
      if (!own.alive || !std::isfinite(own.centre.x + own.centre.y + own.centre.z)) continue;
      const std::optional<vec3> centre = centre_of(i);
      if (centre) from.push_back(*centre), to.push_back(own.centre);
    }
    struct {
      bool known;
      turbomap::isometry<double> T;
    } result{from.size() >= 3, {}};
    if (result.known)
      result.T = turbomap::rigid_alignment(turbomap::span<const vec3>(from), turbomap::span<const vec3>(to));
    return result;
  };

  if (recording.has_ground_truth()) {
    const auto truth = [&](std::size_t i) { return turbomap::true_camera_centre(recording, recording.t_ns[i]); };
    const auto to_map = aligned(truth);
    if (to_map.known) {
      data.ground_truth.clear();
      for (const std::int64_t t : recording.gt_t_ns)
        if (t >= recording.t_ns.front() && t <= recording.t_ns.back())
          data.ground_truth.push_back(to_map.T * *turbomap::true_camera_centre(recording, t));
      data.up = to_map.T * vec3{0, 0, 1} - to_map.T * vec3{0, 0, 0};
    }
  }
  if (recording.has_final()) {
    const auto peer = [&](std::size_t i) -> std::optional<vec3> {
      if (recording.final_alive[i] == 0) return std::nullopt;
      return turbomap::camera_centre(turbomap::to_isometry<double>(recording.final_T_cw[i]));
    };
    const auto to_map = aligned(peer);
    if (to_map.known) {
      data.peer_trajectory.clear();
      for (std::size_t i = 0; i < data.trajectory.size(); ++i)
        if (const auto centre = peer(i)) data.peer_trajectory.push_back(to_map.T * *centre);
    }
  }
}

}  // namespace turbomap_replay
