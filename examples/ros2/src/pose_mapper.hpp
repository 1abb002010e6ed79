// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Local mapping behind somebody else's odometry: one camera's keypoints and its poses in metres come in, a map of points and
/// adjusted keyframes comes out. Knows nothing of ROS; the node beside it does.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdint>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/error.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/math/rotation.hpp>
#include <vector>

namespace example {

struct pose_mapper_options {
  double least_motion = 0.2;    ///< m between keyframes; a choice for indoor scenes of a few metres
  double least_turn = 0.2;      ///< rad: 11 degrees, about a fifth of a usual field of view
  int temporal_neighbours = 5;  ///< keyframes before, that are searched although they share no points yet
};

/// Which images become keyframes.
struct keyframe_choice {
  turbomap::rigid_transform<double> T_cw;  ///< of the last keyframe, by the odometry
  bool any = false;                        ///< there is one

  /// Whether the camera has moved or turned enough since then.
  bool wants(const turbomap::rigid_transform<double>& next_T_cw, const pose_mapper_options& options) const {
    if (!any) return true;
    const auto next = turbomap::inverse(turbomap::to_isometry<double>(next_T_cw)),
               last = turbomap::inverse(turbomap::to_isometry<double>(T_cw));
    // Scalar part of the rotation between two unit quaternions.
    const double w =
        std::abs(next_T_cw.qw * T_cw.qw + next_T_cw.qx * T_cw.qx + next_T_cw.qy * T_cw.qy + next_T_cw.qz * T_cw.qz);
    return turbomap::norm(next.t - last.t) >= options.least_motion ||
           2 * std::acos(std::fmin(1.0, w)) >= options.least_turn;
  }
};

/// A map that grows by keyframes. Not synchronised.
class pose_mapper {
 public:
  using orb = turbomap::binary_descriptor<256>;
  using camera = turbomap::pinhole<float>;
  using map_type = turbomap::simple_map<orb, camera>;
  using traits = turbomap::map_traits<map_type>;
  using pose = turbomap::rigid_transform<double>;

  pose_mapper(const camera& pinhole, const turbomap::image_bounds& bounds, const pose_mapper_options& options = {})
      : rig_(turbomap::make_mono_rig(pinhole)),
        bounds_(bounds),
        mapper_(context_, map_, store_, mapper_options(options)) {}

  /// A keyframe of undistorted keypoints with 32 bytes each, at the odometry's pose. It enters the map at the pose of the keyframe
  /// before and the odometry's motion since, so that what mapping has mended stays.
  /// Throws std::invalid_argument where there are not 32 bytes per keypoint, and for a pose or keypoint that the mapper refuses;
  /// the map is as it was.
  const turbomap::mapping_report& add(const std::vector<turbomap::keypoint>& keypoints,
                                      const std::vector<std::uint8_t>& descriptors, const pose& odometry_T_cw,
                                      double time_s) {
    turbomap::require(descriptors.size() == 32 * keypoints.size(), "descriptors.size()", descriptors.size(),
                      "must be 32 per keypoint");
    pose T_cw = odometry_T_cw;
    // The newest keyframe is in the map: culling leaves the one that is processed alone.
    const auto before = keyframes_.empty() ? turbomap::map_keyframe_id{} : keyframes_.back();
    if (!keyframes_.empty()) {
      const auto motion =
          turbomap::to_isometry<double>(odometry_T_cw) * turbomap::inverse(turbomap::to_isometry<double>(odometry_));
      T_cw = turbomap::to_rigid_transform(motion * turbomap::to_isometry<double>(map_.T_cw(before)));
    }
    const auto k = map_.add_keyframe(keypoints, T_cw, time_s, before);
    try {
      mapper_.insert(k, turbomap::keyframe_data<orb, camera>{static_cast<int>(keypoints.size()), keypoints.data(),
                                                             descriptors.data(), rig_.cameras, 1, bounds_});
    } catch (...) {  // else the next keyframe would stand on one that nobody can use
      turbomap::erase_keyframe(map_, k);
      throw;
    }
    keyframes_.push_back(k);
    odometry_ = odometry_T_cw;
    return mapper_.process(k);
  }

  /// Adjusted poses of the keyframes that are left, in order of time: T_cw.
  std::vector<pose> trajectory() const {
    std::vector<pose> all;
    for (const auto k : keyframes_)
      if (map_.alive(k)) all.push_back(map_.T_cw(k));
    return all;
  }
  /// Positions of all points in the world, m.
  std::vector<turbomap::vec3<float>> points() const {
    std::vector<turbomap::vec3<float>> all;
    traits::for_each_point(map_, [&](turbomap::map_point_id p) {
      if (map_.alive(p)) all.push_back(turbomap::cast<float>(map_.position(p)));
    });
    return all;
  }
  const map_type& map() const { return map_; }

 private:
  static turbomap::local_mapper_options mapper_options(const pose_mapper_options& o) {
    auto options = turbomap::local_mapper_options::monocular();
    options.neighbours.neighbourhood.temporal_neighbours = o.temporal_neighbours;
    options.neighbours.neighbourhood.temporal_targets = o.temporal_neighbours;
    options.neighbours.stereo_baseline = o.least_motion / 2;  // the odometry's unit is known: no median depth is needed
    return options;
  }
  turbomap::rig<camera, 1> rig_;
  turbomap::image_bounds bounds_;
  map_type map_;
  turbomap::context<> context_;  // before the mapper, which refers to it
  turbomap::keyframe_store<orb, camera> store_;
  turbomap::local_mapper<map_type, turbomap::context<>::policy_type> mapper_;
  std::vector<turbomap::map_keyframe_id> keyframes_;
  pose odometry_;  ///< at the last keyframe
};

}  // namespace example
