// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The one list of the arrays of a recording: name of the file, field, number of rows, whether it must be there.
/// Reader, validator and writer go through it, so that they cannot disagree.

#include <cstddef>

#include "../config.hpp"
#include "npy.hpp"
#include "recording_data.hpp"

namespace turbomap {

/// A row: keyframe index, keypoint index.
template <>
struct npy_row<keypoint_reference> {
  /// @{
  /// As in npy_row.
  using scalar = std::int32_t;
  static constexpr std::size_t columns = 2;
  /// @}
};
/// A row: position in m, then the quaternion with its real part first.
template <>
struct npy_row<stamped_body_pose> {
  /// @{
  /// As in npy_row.
  using scalar = double;
  static constexpr std::size_t columns = 7;
  /// @}
};
/// A row: angular rate (rad/s) x y z, acceleration (m/s^2) x y z.
template <>
struct npy_row<imu_sample> {
  /// @{
  /// As in npy_row.
  using scalar = double;
  static constexpr std::size_t columns = 6;
  /// @}
};

/// What the rows of an array of a recording count.
enum class recording_rows {
  keyframes,
  keyframe_offsets,
  keypoints,
  associations,
  recent,
  imu,
  ground_truth,
  frames,
  scene_points
};

/// Must the file be there? An optional array is left empty, and must be there when its group's first one is.
enum class presence { required, optional };

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Calls visit(file name without extension, vector, recording_rows, presence) for every array of the recording `r`.
template <class Recording, class Visit>
void visit_arrays(Recording& r, Visit&& visit) {
  using rows = recording_rows;
  constexpr auto required = presence::required, optional = presence::optional;
  visit("log_kf_mnid", r.kf_mnid, rows::keyframes, required);
  visit("log_frame_id", r.frame_id, rows::keyframes, required);
  visit("log_prev_kf", r.prev_kf, rows::keyframes, required);
  visit("log_t_ns", r.t_ns, rows::keyframes, required);
  visit("log_Tcw", r.T_cw, rows::keyframes, required);
  visit("log_nleft", r.nleft, rows::keyframes, required);

  visit("log_kp_off", r.kp_off, rows::keyframe_offsets, required);
  visit("log_kp_xy", r.kp_xy, rows::keypoints, required);
  visit("log_kp_octave", r.kp_octave, rows::keypoints, required);
  visit("log_kp_angle", r.kp_angle, rows::keypoints, required);
  visit("log_kp_uright", r.kp_uright, rows::keypoints, required);
  visit("log_kp_depth", r.kp_depth, rows::keypoints, required);
  visit("log_kp_lrmatch", r.kp_lrmatch, rows::keypoints, required);
  visit("log_kp_desc", r.kp_desc, rows::keypoints, required);
  visit("log_kp_node", r.kp_node, rows::keypoints, required);

  visit("log_assoc_off", r.assoc_off, rows::keyframe_offsets, required);
  visit("log_assoc_kp", r.assoc_kp, rows::associations, required);
  visit("log_assoc_ref", r.assoc_ref, rows::associations, required);
  visit("log_assoc_ref2", r.assoc_ref2, rows::associations, required);
  visit("log_assoc_new", r.assoc_new, rows::associations, required);
  visit("log_assoc_pos", r.assoc_pos, rows::associations, required);

  visit("log_recent_off", r.recent_off, rows::keyframe_offsets, required);
  visit("log_recent_ref", r.recent_ref, rows::recent, required);
  visit("log_recent_firstkf_mnid", r.recent_firstkf_mnid, rows::recent, required);
  visit("log_recent_visible", r.recent_visible, rows::recent, required);
  visit("log_recent_found", r.recent_found, rows::recent, required);

  visit("log_vel", r.velocity, rows::keyframes, optional);
  visit("log_bias", r.bias, rows::keyframes, optional);
  visit("log_bimu", r.bimu, rows::keyframes, optional);
  visit("imu_t_ns", r.imu_t_ns, rows::imu, optional);
  visit("imu_gyro_acc", r.imu, rows::imu, optional);
  visit("gt_t_ns", r.gt_t_ns, rows::ground_truth, optional);
  visit("gt_Twb", r.gt_T_wb, rows::ground_truth, optional);

  visit("frame_t_ns", r.frame_t_ns, rows::frames, optional);
  visit("frame_Tcw", r.frame_T_cw, rows::frames, optional);
  visit("frame_state", r.frame_state, rows::frames, optional);
  visit("final_Tcw", r.final_T_cw, rows::keyframes, optional);
  visit("final_alive", r.final_alive, rows::keyframes, optional);

  visit("sim_point_id", r.sim_point_id, rows::keypoints, optional);
  visit("sim_track_id", r.sim_track_id, rows::keypoints, optional);
  visit("sim_point_xyz", r.sim_point_xyz, rows::scene_points, optional);
  visit("sim_point_normal", r.sim_point_normal, rows::scene_points, optional);
  visit("sim_Tcw_true", r.sim_T_cw_true, rows::keyframes, optional);
  visit("sim_vel_true", r.sim_velocity_true, rows::keyframes, optional);
  visit("sim_bias_true", r.sim_bias_true, rows::keyframes, optional);
}

TURBOMAP_END_NAMESPACE
