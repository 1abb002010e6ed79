// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From a recording to the library's types: the rig of the run, and keyframes inserted into a store.

#include <vector>

#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/measure_resolution.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/store/keyframe_store.hpp>

namespace turbomap_replay {

using orb = turbomap::binary_descriptor<256>;

inline void read_camera(const std::vector<double>& p, turbomap::pinhole<float>& camera) {
  camera.fx = static_cast<float>(p[0]), camera.fy = static_cast<float>(p[1]);
  camera.cx = static_cast<float>(p[2]), camera.cy = static_cast<float>(p[3]);
}
inline void read_camera(const std::vector<double>& p, turbomap::kannala_brandt<float>& camera) {
  camera.fx = static_cast<float>(p[0]), camera.fy = static_cast<float>(p[1]);
  camera.cx = static_cast<float>(p[2]), camera.cy = static_cast<float>(p[3]);
  camera.k1 = static_cast<float>(p[4]), camera.k2 = static_cast<float>(p[5]);
  camera.k3 = static_cast<float>(p[6]), camera.k4 = static_cast<float>(p[7]);
}

/// The rig of a run: one rectified camera with u_right, or two fisheye cameras, the left one being the body.
template <class Camera>
std::vector<turbomap::rig_camera<Camera>> recorded_rig(const turbomap::recording_meta& meta) {
  std::vector<turbomap::rig_camera<Camera>> rig(meta.camera2.empty() ? 1 : 2);
  read_camera(meta.camera1, rig[0].camera);
  if (rig.size() == 2) {
    read_camera(meta.camera2, rig[1].camera);
    rig[1].T_camera_body = turbomap::cast<double>(meta.T_rl);
  } else {
    rig[0].bf = meta.bf;
  }
  for (auto& camera : rig) camera.resolution = turbomap::measure_resolution(camera.camera, meta.bounds);
  return rig;
}

/// Store options of a run.
inline turbomap::keyframe_store_options recorded_store_options(const turbomap::recording_meta& meta) {
  turbomap::keyframe_store_options options;
  options.packing.grid_columns = meta.grid_columns;
  options.packing.grid_rows = meta.grid_rows;
  options.packing.pyramid = meta.pyramid();
  return options;
}

/// One recorded keyframe as host data; `keypoints` backs it.
template <class Camera>
turbomap::keyframe_data<orb, Camera> recorded_keyframe(const turbomap::recording& recording, std::size_t i,
                                                       const std::vector<turbomap::rig_camera<Camera>>& rig,
                                                       std::vector<turbomap::keypoint>& keypoints) {
  keypoints = recording.gather_keypoints(i);
  turbomap::keyframe_data<orb, Camera> data;
  data.keypoint_count = static_cast<int>(keypoints.size());
  data.keypoints = keypoints.data();
  data.descriptors = keypoints.empty() ? nullptr : recording.descriptors(i).data()->data();
  data.cameras = rig.data();
  data.camera_count = static_cast<int>(rig.size());
  data.bounds = recording.meta.bounds;
  return data;
}

/// The pose of keyframe i at which ground truth places it (T_cw of the left camera, in the ground truth's world), from the
/// sample nearest in time.
inline turbomap::isometry<double> true_pose(const turbomap::recording& recording, std::size_t i) {
  const auto& times = recording.gt_t_ns;
  const std::int64_t t = recording.t_ns[i];
  std::size_t k = static_cast<std::size_t>(std::lower_bound(times.begin(), times.end(), t) - times.begin());
  if (k == times.size() || (k > 0 && t - times[k - 1] < times[k] - t)) --k;
  const auto& g = recording.gt_T_wb[k];
  const turbomap::rigid_transform<double> T_wb{g.qx, g.qy, g.qz, g.qw, g.px, g.py, g.pz};
  const auto T_bc = turbomap::to_isometry<double>(recording.meta.T_bc);
  return turbomap::inverse(turbomap::to_isometry<double>(T_wb) * T_bc);
}

}  // namespace turbomap_replay
