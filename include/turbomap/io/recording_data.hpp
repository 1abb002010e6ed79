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
  std::int32_t keyframe = -1;  ///< keyframe index
  std::int32_t keypoint = -1;  ///< keypoint index, within its keyframe
};

/// A body pose in the world as ground truth gives it: position, then the quaternion with its real part first.
struct stamped_body_pose {
  /// @{
  /// px, py, pz in the world, m; the unit quaternion turns the body's axes into the world's.
  double px, py, pz, qw, qx, qy, qz;
  /// @}
};

/// 256 bits, as an ORB extractor gives them.
using descriptor_bytes = std::array<std::uint8_t, 32>;

/// Something that changed the whole map at once: the world frame jumps at the start of this iteration's successor.
struct recording_event {
  std::int32_t iteration = 0;               ///< of local mapping, as the recorded system counts them
  std::string name;                         ///< what happened, in the recorded system's words
  std::int32_t imu_initialized_before = 0;  ///< 1: the IMU was initialised before
  std::int32_t imu_initialized_after = 0;   ///< 1: it is afterwards
  double scale = 1;                         ///< of the new world by the old one; 1: none
};

/// What holds for the whole run.
struct recording_meta {
  std::string sensor = "stereo";          ///< stereo, inertial (stereo with an IMU), monocular
  std::string model = "Pinhole";          ///< Pinhole or KannalaBrandt8: what camera1 and camera2 hold
  int width = 0;                          ///< of the image, px
  int height = 0;                         ///< px
  std::vector<double> camera1;            ///< left: fx fy cx cy, px; a fisheye also k1..k4
  std::vector<double> camera2;            ///< right, in the same way; empty without a second camera
  rigid_transform<float> T_lr;            ///< right to left camera; identity without a second camera
  rigid_transform<float> T_rl;            ///< left to right camera
  rigid_transform<float> T_bc;            ///< left camera to body
  double bf = 0;                          ///< baseline times fx, px m; 0 for one camera
  double baseline = 0;                    ///< m
  double close_depth = 0;                 ///< m; stereo points beyond are 'far'
  int levels = 8;                         ///< of the pyramid of images, 1 to 255
  float scale_factor = 1.2F;              ///< of a level to the next coarser one, above 1
  float log_scale_factor = 0.182321593F;  ///< its natural logarithm
  std::vector<float> scale_factors;       ///< one per level: px of the full image per px of the level
  std::vector<float> level_sigma2;        ///< one per level: variance of a keypoint, px^2
  std::vector<float> inv_level_sigma2;    ///< one per level: its inverse, px^-2
  image_bounds bounds;                    ///< of undistorted keypoints, px
  int grid_columns = 64;                  ///< cells of the grid of keypoints in x
  int grid_rows = 48;                     ///< in y
  float cell_width_inverse = 0;           ///< cells per px, in x
  float cell_height_inverse = 0;          ///< cells per px, in y
  /// Of one sample: gyro xyz, (rad/s)^2, acceleration xyz, (m/s^2)^2; empty without IMU.
  std::vector<double> imu_noise_variance;
  /// Of the biases' change from sample to sample, in the same order; empty without IMU.
  std::vector<double> imu_walk_variance;
  /// Simulated recordings: standard deviation of u and v, px at the finest level; -1: not known.
  double noise_px = -1;
  /// Simulated recordings: that of the disparity of a rectified pair, px at the finest level; -1: not known.
  double disparity_noise_px = -1;
  /// What keypoints are pixels of: full_image; multiplied: their pyramid level, times its scale (in_full_image() mends that);
  /// or unknown.
  std::string keypoint_pixels = "unknown";
  std::vector<recording_event> events;  ///< in the order of iterations
  std::vector<std::int32_t> snapshots;  ///< iterations of which every stage's input and output is there
  // What the recorded system reported in the end; -1: unknown.
  int frames = -1;               ///< frames that tracking was given
  int frames_not_ok = -1;        ///< those that it did not track
  int keyframes_inserted = -1;   ///< keyframes given to local mapping
  int keyframes_alive_end = -1;  ///< those that were not culled
  int map_points_end = -1;       ///< points alive
  int maps = 1;                  ///< more than one: tracking was lost, and a new map begun
  double ate_kf_rmse_m = -1;     ///< root mean square error of keyframe positions, after alignment, m
  double ate_live_rmse_m = -1;   ///< that of frames as they were tracked, m
  double sim3_scale = -1;        ///< scale of an alignment with scale

  /// Two cameras without rectification: keypoints of both are in one list.
  bool is_fisheye() const { return model == "KannalaBrandt8"; }
  /// The pyramid of images as the library's options take it.
  turbomap::pyramid pyramid() const { return {scale_factor, levels}; }
};

/// The rows [begin, end) of a flat array that belong to one keyframe.
struct row_range {
  std::size_t begin = 0;  ///< first row
  std::size_t end = 0;    ///< behind the last row
  /// Number of rows.
  std::size_t size() const { return end - begin; }
};

/// The rows of an array in a range.
template <class T>
span<const T> slice(const std::vector<T>& values, row_range rows) {
  return {values.data() + rows.begin, rows.size()};
}

/// A whole recording. Field names are those of the files (without `log_`). Optional arrays are empty when not there.
struct recording {
  recording_meta meta;  ///< what holds for the whole run

  // One row per keyframe.
  std::vector<std::int32_t> kf_mnid;         ///< the recorded system's own id of the keyframe
  std::vector<std::int32_t> frame_id;        ///< its own id of the frame that became it
  std::vector<std::int32_t> prev_kf;         ///< keyframe index of the predecessor in time; -1: none
  std::vector<std::int64_t> t_ns;            ///< time, ns; never falls
  std::vector<rigid_transform<float>> T_cw;  ///< tracking's estimate at insertion, world to left camera
  std::vector<std::int32_t> nleft;           ///< number of left keypoints; -1: one camera, no right keypoints

  // One row per keypoint; kp_off has K + 1 offsets.
  std::vector<std::int64_t> kp_off;       ///< first row of each keyframe in the kp_ arrays
  std::vector<vec2<float>> kp_xy;         ///< pixel: undistorted (pinhole), raw (fisheye)
  std::vector<std::uint8_t> kp_octave;    ///< level of the pyramid; 0 is the finest
  std::vector<float> kp_angle;            ///< degrees
  std::vector<float> kp_uright;           ///< column in the right image, px; -1: none
  std::vector<float> kp_depth;            ///< m; -1: none
  std::vector<std::int32_t> kp_lrmatch;   ///< fisheye: the stereo partner in the other image, -1: none
  std::vector<descriptor_bytes> kp_desc;  ///< 256 bits
  std::vector<std::uint32_t> kp_node;     ///< visual word group, keypoint::no_group: none

  // One row an association of a keypoint with a map point; assoc_off has K + 1 offsets.
  std::vector<std::int64_t> assoc_off;         ///< first row of each keyframe in the assoc_ arrays
  std::vector<std::int32_t> assoc_kp;          ///< a keypoint of the keyframe that shows a map point
  std::vector<keypoint_reference> assoc_ref;   ///< the point's most recent observation before
  std::vector<keypoint_reference> assoc_ref2;  ///< its earliest observation
  std::vector<std::uint8_t> assoc_new;         ///< 1: the point was created by this keyframe (stereo)
  std::vector<vec3<float>> assoc_pos;          ///< the point in the world at that moment

  // One row per point still on probation before the culling of recent points; recent_off has K + 1 offsets.
  std::vector<std::int64_t> recent_off;           ///< first row of each keyframe in the recent_ arrays
  std::vector<keypoint_reference> recent_ref;     ///< an observation that names the point
  std::vector<std::int32_t> recent_firstkf_mnid;  ///< the recorded system's id of the keyframe that made it
  std::vector<std::int32_t> recent_visible;       ///< frames in whose view it was
  std::vector<std::int32_t> recent_found;         ///< frames that matched it

  // Inertial runs, one row per keyframe.
  std::vector<vec3<float>> velocity;       ///< of the body in the world, m/s
  std::vector<std::array<float, 6>> bias;  ///< gyro xyz (rad/s), acceleration xyz (m/s^2)
  std::vector<std::uint8_t> bimu;          ///< 1: velocity and bias are estimated
  std::vector<std::int64_t> imu_t_ns;      ///< times of IMU samples, ns
  std::vector<imu_sample> imu;             ///< IMU samples, in the frame of the body

  std::vector<std::int64_t> gt_t_ns;       ///< times of ground truth, ns
  std::vector<stamped_body_pose> gt_T_wb;  ///< ground truth: body in its own world

  // The recorded system's own results.
  std::vector<std::int64_t> frame_t_ns;            ///< times of all frames, ns
  std::vector<rigid_transform<float>> frame_T_cw;  ///< their poses as tracked, world to left camera
  std::vector<std::uint8_t> frame_state;           ///< 2: tracked; the pose of any other frame means nothing
  std::vector<rigid_transform<float>> final_T_cw;  ///< poses of the keyframes in the end, world to left camera
  std::vector<std::uint8_t> final_alive;           ///< 1: the keyframe was not culled

  // Simulated recordings: the truth. World = the recording's world before drift.
  std::vector<std::int32_t> sim_point_id;  ///< per keypoint: the scene point it shows, -1: clutter
  std::vector<std::int32_t>
      sim_track_id;  ///< per keypoint: tracking's map point, -1: none; two of one scene point are duplicates
  std::vector<vec3<float>> sim_point_xyz;             ///< per scene point: position, m
  std::vector<vec3<float>> sim_point_normal;          ///< per scene point: unit normal out of the surface
  std::vector<rigid_transform<float>> sim_T_cw_true;  ///< per keyframe
  std::vector<vec3<float>> sim_velocity_true;         ///< per keyframe of an inertial run: of the IMU in the world, m/s
  std::vector<std::array<float, 6>> sim_bias_true;    ///< ... as `bias`

  /// Number of keyframes.
  std::size_t keyframe_count() const { return t_ns.size(); }
  /// Whether there are IMU samples.
  bool has_imu() const { return !imu.empty(); }
  /// Whether velocities and biases of the keyframes are there.
  bool has_velocity() const { return !velocity.empty(); }
  /// Whether ground truth is there.
  bool has_ground_truth() const { return !gt_T_wb.empty(); }
  /// Whether the recorded system's final poses are there.
  bool has_final() const { return !final_T_cw.empty(); }
  /// Whether the truth of a simulation is there.
  bool is_simulated() const { return !sim_point_id.empty(); }

  /// Rows of the `kp_*` arrays of keyframe i. Here and below: not checked that i < keyframe_count().
  row_range keypoints(std::size_t i) const { return rows(kp_off, i); }
  /// Rows of the `assoc_*` arrays of keyframe i.
  row_range associations(std::size_t i) const { return rows(assoc_off, i); }
  /// Rows of the `recent_*` arrays of keyframe i.
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
