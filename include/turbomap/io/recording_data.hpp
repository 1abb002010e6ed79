// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recording of local mapping in memory: what tracking handed over, keyframe by keyframe, as flat arrays with offsets
/// (CSR). All lengths are metres, times nanoseconds (`t_ns`), pixels of the image that mapping uses. A *keyframe index*
/// is the order of insertion, 0..K-1; a *keypoint index* counts within its keyframe (a fisheye pair: left ones first).

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "../inertial/imu_samples.hpp"
#include "../span.hpp"
#include "../types.hpp"

namespace turbomap {

/// One keypoint of one keyframe; {-1, -1} refers to nothing.
struct keypoint_reference {
  std::int32_t keyframe = -1, keypoint = -1;
};

/// A body pose in the world as ground truth gives it: position, then the quaternion with its real part first.
struct stamped_body_pose {
  double px, py, pz, qw, qx, qy, qz;
};

/// 256 bits, as an ORB extractor gives them.
using descriptor_bytes = std::array<std::uint8_t, 32>;

/// Something that changed the whole map at once: the world frame jumps at the start of this iteration's successor.
struct recording_event {
  std::int32_t iteration = 0;
  std::string name;
  std::int32_t imu_initialized_before = 0, imu_initialized_after = 0;
  double scale = 1;
};

/// What holds for the whole run.
struct recording_meta {
  std::string sensor = "stereo";  ///< stereo, inertial (stereo with an IMU), monocular
  std::string model = "Pinhole";  ///< Pinhole or KannalaBrandt8: what camera1 and camera2 hold
  int width = 0, height = 0;
  std::vector<double> camera1, camera2;  ///< fx fy cx cy, fisheye also k1..k4; camera2 is empty without a second camera
  rigid_transform<float> T_lr, T_rl;     ///< right to left camera and back; identity without a second camera
  rigid_transform<float> T_bc;           ///< left camera to body
  double bf = 0;                         ///< baseline times fx, px m; 0 for one camera
  double baseline = 0;                   ///< m
  double close_depth = 0;                ///< m; stereo points beyond are 'far'
  int levels = 8;
  float scale_factor = 1.2F, log_scale_factor = 0.182321593F;
  std::vector<float> scale_factors, level_sigma2, inv_level_sigma2;  ///< one per level
  image_bounds bounds;
  int grid_columns = 64, grid_rows = 48;
  float cell_width_inverse = 0, cell_height_inverse = 0;  ///< cells per pixel
  std::vector<double> imu_noise_variance,
      imu_walk_variance;  ///< discrete; gyro xyz, acceleration xyz; empty without IMU
  /// Simulated recordings: standard deviations (px, finest level) of u and v, and of the disparity of a rectified pair;
  /// -1: not known.
  double noise_px = -1, disparity_noise_px = -1;
  std::vector<recording_event> events;
  std::vector<std::int32_t> snapshots;  ///< iterations of which every stage's input and output is there
  // What the recorded system reported in the end; -1: unknown.
  int frames = -1, frames_not_ok = -1, keyframes_inserted = -1, keyframes_alive_end = -1, map_points_end = -1, maps = 1;
  double ate_kf_rmse_m = -1, ate_live_rmse_m = -1, sim3_scale = -1;

  /// Two cameras without rectification: keypoints of both are in one list.
  bool is_fisheye() const { return model == "KannalaBrandt8"; }
  turbomap::pyramid pyramid() const { return {scale_factor, levels}; }
};

/// The rows [begin, end) of a flat array that belong to one keyframe.
struct row_range {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
};

/// The rows of an array in a range.
template <class T>
span<const T> slice(const std::vector<T>& values, row_range rows) {
  return {values.data() + rows.begin, rows.size()};
}

/// A whole recording. Field names are those of the files (without `log_`). Optional arrays are empty when not there.
struct recording {
  recording_meta meta;

  // One row per keyframe.
  std::vector<std::int32_t> kf_mnid, frame_id, prev_kf;  ///< the peer's own ids; index of the predecessor in time or -1
  std::vector<std::int64_t> t_ns;
  std::vector<rigid_transform<float>> T_cw;  ///< tracking's estimate at insertion, world to left camera
  std::vector<std::int32_t> nleft;           ///< number of left keypoints; -1: one camera, no right keypoints

  // One row per keypoint; kp_off has K + 1 offsets.
  std::vector<std::int64_t> kp_off;
  std::vector<vec2<float>> kp_xy;
  std::vector<std::uint8_t> kp_octave;
  std::vector<float> kp_angle, kp_uright, kp_depth;  ///< degrees; px or -1; m or -1
  std::vector<std::int32_t> kp_lrmatch;              ///< fisheye: the stereo partner in the other image, -1: none
  std::vector<descriptor_bytes> kp_desc;
  std::vector<std::uint32_t> kp_node;  ///< visual word group, keypoint::no_group: none

  // One row an association of a keypoint with a map point; assoc_off has K + 1 offsets.
  std::vector<std::int64_t> assoc_off;
  std::vector<std::int32_t> assoc_kp;
  std::vector<keypoint_reference> assoc_ref, assoc_ref2;  ///< most recent and earliest earlier observation of the point
  std::vector<std::uint8_t> assoc_new;                    ///< 1: the point was created by this keyframe (stereo)
  std::vector<vec3<float>> assoc_pos;                     ///< the point in the world at that moment

  // One row per point still on probation before the culling of recent points; recent_off has K + 1 offsets.
  std::vector<std::int64_t> recent_off;
  std::vector<keypoint_reference> recent_ref;
  std::vector<std::int32_t> recent_firstkf_mnid, recent_visible, recent_found;

  // Inertial runs, one row per keyframe.
  std::vector<vec3<float>> velocity;
  std::vector<std::array<float, 6>> bias;  ///< gyro xyz (rad/s), acceleration xyz (m/s^2)
  std::vector<std::uint8_t> bimu;          ///< 1: velocity and bias are estimated
  std::vector<std::int64_t> imu_t_ns;
  std::vector<imu_sample> imu;

  std::vector<std::int64_t> gt_t_ns;
  std::vector<stamped_body_pose> gt_T_wb;

  // The recorded system's own results.
  std::vector<std::int64_t> frame_t_ns;
  std::vector<rigid_transform<float>> frame_T_cw;
  std::vector<std::uint8_t> frame_state;  ///< 2: tracked; the pose of any other frame means nothing
  std::vector<rigid_transform<float>> final_T_cw;
  std::vector<std::uint8_t> final_alive;

  // Simulated recordings: the truth. World = the recording's world before drift.
  std::vector<std::int32_t> sim_point_id;  ///< per keypoint: the scene point it shows, -1: clutter
  std::vector<std::int32_t>
      sim_track_id;  ///< per keypoint: tracking's map point, -1: none; two of one scene point are duplicates
  std::vector<vec3<float>> sim_point_xyz, sim_point_normal;  ///< per scene point; unit normals out of the surface
  std::vector<rigid_transform<float>> sim_T_cw_true;         ///< per keyframe
  std::vector<vec3<float>> sim_velocity_true;       ///< per keyframe of an inertial run: of the IMU in the world, m/s
  std::vector<std::array<float, 6>> sim_bias_true;  ///< ... as `bias`

  std::size_t keyframe_count() const { return t_ns.size(); }
  bool has_imu() const { return !imu.empty(); }
  bool has_velocity() const { return !velocity.empty(); }
  bool has_ground_truth() const { return !gt_T_wb.empty(); }
  bool has_final() const { return !final_T_cw.empty(); }
  bool is_simulated() const { return !sim_point_id.empty(); }

  /// Rows of the `kp_*`, `assoc_*` and `recent_*` arrays of keyframe i (not checked: i < keyframe_count()).
  row_range keypoints(std::size_t i) const { return rows(kp_off, i); }
  row_range associations(std::size_t i) const { return rows(assoc_off, i); }
  row_range recent(std::size_t i) const { return rows(recent_off, i); }

  /// The keypoints of keyframe i as the library takes them; camera 1 = right image.
  std::vector<keypoint> gather_keypoints(std::size_t i) const {
    const row_range range = keypoints(i);
    std::vector<keypoint> gathered(range.size());
    for (std::size_t k = 0; k < gathered.size(); ++k) {
      const std::size_t row = range.begin + k;
      const bool right = nleft[i] >= 0 && k >= static_cast<std::size_t>(nleft[i]);
      gathered[k] = {kp_xy[row].x,  kp_xy[row].y, kp_angle[row],  kp_uright[row],
                     kp_depth[row], kp_node[row], kp_octave[row], static_cast<std::uint8_t>(right)};
    }
    return gathered;
  }
  /// The descriptors of keyframe i, in keypoint order.
  span<const descriptor_bytes> descriptors(std::size_t i) const { return slice(kp_desc, keypoints(i)); }

 private:
  static row_range rows(const std::vector<std::int64_t>& offsets, std::size_t i) {
    return {static_cast<std::size_t>(offsets[i]), static_cast<std::size_t>(offsets[i + 1])};
  }
};

}  // namespace turbomap
