// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a random scene is made of: the recipe, and keyframes that own their arrays.

#include <turbomap/array.hpp>
#include <turbomap/matching/search_options.hpp>
#include <turbomap/store/keyframe_packing.hpp>
#include <turbomap/store/posed_keyframe.hpp>

#include <cstdint>
#include <vector>

#include "reference/eigen.hpp"

namespace turbomap_test {

/// How a neighbour stands to the query.
enum class motion {
  sideways,
  forward,  ///< the query is in front of the neighbour: the epipole is in the image
  backward,
  along_axis,      ///< forward without any rotation: the baseline is the optical axis
  turn_at_origin,  ///< both at the origin exactly: no baseline at all
  identical,       ///< the same pose somewhere
  anything         ///< any rotation, any direction, lengths over four decades
};

struct scene_recipe {
  unsigned seed = 1;
  motion how = motion::sideways;
  int query_keypoints = 150, neighbour_keypoints = 150, neighbours = 3;
  int levels = 8;
  float scale_factor = 1.2F;
  double landmarks = 0.6;   ///< share of the query's keypoints that the neighbours may see
  double at_epipole = 0.1;  ///< share of a neighbour's keypoints within 30 px of an epipole
  double stereo = 0.5;      ///< share of u_right where the rig has bf
  double mapped = 0.3;      ///< share of keypoints with a map point; < 0: an empty mask
  int groups = 12;
  int prototypes = 6;  ///< descriptors are one of these with a few bits changed
  int noise = 10;      ///< at most so many bits (elements)
};

/// A keyframe that owns its arrays, packed in host memory.
template <class Descriptor, class Camera>
struct scene_frame {
  std::vector<turbomap::keypoint> keypoints;
  std::vector<typename Descriptor::element> descriptors;
  std::vector<turbomap::rig_camera<Camera>> cameras;
  turbomap::image_bounds bounds{};
  turbomap::rigid_transform<double> T_cw;
  std::vector<std::uint8_t> has_point;
  turbomap::keyframe_layout layout;
  turbomap::array<std::byte, turbomap::host_memory> block;

  void pack(turbomap::keyframe_packing_scratch& scratch, const turbomap::pyramid& pyramid) {
    turbomap::keyframe_data<Descriptor, Camera> data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data(), data.descriptors = descriptors.data();
    data.cameras = cameras.data(), data.camera_count = static_cast<int>(cameras.size());
    data.bounds = bounds;
    turbomap::keyframe_packing_options options;
    options.grid_columns = options.grid_rows = 0;
    options.pyramid = pyramid;
    layout = turbomap::plan_packing(data, options, scratch);
    block.resize_discard(layout.bytes + 1);
    turbomap::pack_keyframe(data, layout, scratch, block.data());
  }
  turbomap::posed_keyframe<Descriptor, Camera> posed(std::byte* base) const {
    return {turbomap::view_at<Descriptor, Camera>(layout, base), T_cw, has_point};
  }
  turbomap::posed_keyframe<Descriptor, Camera> posed() { return posed(block.data()); }
};

inline turbomap::rigid_transform<double> to_rigid(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) {
  turbomap::rigid_transform<double> T;
  T.qx = q.x(), T.qy = q.y(), T.qz = q.z(), T.qw = q.w();
  T.tx = t.x(), T.ty = t.y(), T.tz = t.z();
  return T;
}
inline Eigen::Isometry3d to_eigen(const turbomap::rigid_transform<double>& T) {
  return Eigen::Translation3d(T.tx, T.ty, T.tz) * Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz);
}

}  // namespace turbomap_test
