// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How far the keyframes of a replay are from the ground truth, beside what they can be compared with: the poses that came
/// in, the best that the observations allow (simulated recordings), and the recorded system.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

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

inline std::vector<turbomap::rigid_transform<double>> doubles(
    const std::vector<turbomap::rigid_transform<float>>& T_cw) {
  std::vector<turbomap::rigid_transform<double>> result;
  for (const auto& T : T_cw) result.push_back(turbomap::cast<double>(T));
  return result;
}

/// The scale of the similarity that takes the keyframes that are left to the ground truth: 1 where a metre is a metre.
inline double trajectory_scale(const turbomap::recording& recording,
                               const std::vector<turbomap::rigid_transform<double>>& T_cw,
                               const std::vector<std::uint8_t>& alive) {
  std::vector<turbomap::vec3<double>> estimate, truth;
  for (std::size_t i = 0; i < T_cw.size(); ++i) {
    const auto centre = turbomap::true_camera_centre(recording, recording.t_ns[i]);
    if (alive[i] == 0 || !centre) continue;
    estimate.push_back(turbomap::camera_centre(turbomap::to_isometry<double>(T_cw[i])));
    truth.push_back(*centre);
  }
  if (estimate.size() < 3) return std::nan("");
  const auto T = Eigen::umeyama(turbomap::detail::matrix_of(estimate), turbomap::detail::matrix_of(truth), true);
  return T.topLeftCorner<3, 3>().colwise().norm().mean();
}

/// The error of the keyframes that are left between the events at which the recorded world jumped, each interval aligned by
/// itself.
inline std::vector<double> interval_errors(const turbomap::recording& recording,
                                           const std::vector<turbomap::rigid_transform<double>>& T_cw,
                                           const std::vector<std::uint8_t>& alive) {
  std::vector<std::size_t> begin{0};
  for (const auto& event : recording.meta.events) begin.push_back(static_cast<std::size_t>(event.iteration) + 1);
  begin.push_back(T_cw.size());
  std::vector<double> errors;
  for (std::size_t n = 0; n + 1 < begin.size(); ++n) {
    std::vector<std::uint8_t> inside(T_cw.size(), 0);
    for (std::size_t i = begin[n]; i < begin[n + 1] && i < inside.size(); ++i) inside[i] = alive[i];
    errors.push_back(trajectory_error(recording, T_cw, inside));
  }
  return errors;
}

/// Keyframes that are left at whose time ground truth says where the camera was.
inline std::size_t covered_keyframes(const turbomap::recording& recording, const std::vector<std::uint8_t>& alive) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < alive.size(); ++i)
    count += alive[i] != 0 && turbomap::true_camera_centre(recording, recording.t_ns[i]) ? 1 : 0;
  return count;
}

/// Sets the keys `ate_*_m`, `ate_keyframes` and `peer_ate_rmse_m`, as far as they are known, that of the batch adjustment if `bound`. All are errors after the alignment of
/// keyframe_trajectory_error(); the result's counts the keyframes that are left, the others count all.
template <class Camera, class Policy>
void add_trajectory_errors(const turbomap::recording& recording, const Policy& policy,
                           const std::vector<turbomap::rigid_transform<double>>& T_cw,
                           const std::vector<std::uint8_t>& alive, nlohmann::json& json, bool bound = true) {
  if (!recording.has_ground_truth()) return;
  json["ate_rmse_m"] = trajectory_error(recording, T_cw, alive);
  json["ate_keyframes"] = covered_keyframes(recording, alive);
  json["ate_input_rmse_m"] = turbomap::keyframe_trajectory_error(recording, recording.T_cw);
  if (recording.meta.ate_kf_rmse_m >= 0) json["peer_ate_rmse_m"] = recording.meta.ate_kf_rmse_m;
  if (recording.meta.sensor == "inertial") {
    json["scale_error"] = std::abs(trajectory_scale(recording, T_cw, alive) - 1);
    json["ate_intervals_m"] = interval_errors(recording, T_cw, alive);
    if (recording.has_final())
      json["peer_ate_intervals_m"] = interval_errors(recording, doubles(recording.final_T_cw), recording.final_alive);
  }
  if (!recording.is_simulated() || !bound) return;
  const turbomap_program::progress bar("adjustment of all true observations", 1);
  json["ate_batch_rmse_m"] = trajectory_error(recording, batch_poses<Camera>(recording, policy));
}

}  // namespace turbomap_replay
