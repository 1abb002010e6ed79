// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How far the keyframes of a replay are from the ground truth, beside what they can be compared with: the poses that came
/// in, the best that the observations allow (simulated recordings), and the recorded system.

#include <cstdint>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/io/trajectory_error.hpp>
#include <turbomap/math/linear.hpp>

#include "batch_bound.hpp"
#include "progress.hpp"

namespace turbomap_replay {

inline double trajectory_error(const turbomap::recording& recording,
                               const std::vector<turbomap::rigid_transform<double>>& T_cw,
                               const std::vector<std::uint8_t>& alive = {}) {
  std::vector<turbomap::rigid_transform<float>> poses;
  for (const auto& T : T_cw) poses.push_back(turbomap::cast<float>(T));
  return turbomap::keyframe_trajectory_error(recording, poses, alive);
}

/// Sets the keys `ate_*_m` and `peer_ate_rmse_m`, as far as they are known, that of the batch adjustment if `bound`. All are errors after the alignment of
/// keyframe_trajectory_error(); the result's counts the keyframes that are left, the others count all.
template <class Camera, class Policy>
void add_trajectory_errors(const turbomap::recording& recording, const Policy& policy,
                           const std::vector<turbomap::rigid_transform<double>>& T_cw,
                           const std::vector<std::uint8_t>& alive, nlohmann::json& json, bool bound = true) {
  if (!recording.has_ground_truth()) return;
  json["ate_rmse_m"] = trajectory_error(recording, T_cw, alive);
  json["ate_input_rmse_m"] = turbomap::keyframe_trajectory_error(recording, recording.T_cw);
  if (recording.meta.ate_kf_rmse_m >= 0) json["peer_ate_rmse_m"] = recording.meta.ate_kf_rmse_m;
  if (!recording.is_simulated() || !bound) return;
  const turbomap_program::progress bar("adjustment of all true observations", 1);
  json["ate_batch_rmse_m"] = trajectory_error(recording, batch_poses<Camera>(recording, policy));
}

}  // namespace turbomap_replay
