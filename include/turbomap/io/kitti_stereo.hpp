// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads the stereo bundle adjustment problems of KITTI sequences that GTSAM ships as text (examples/Data/VO_*.txt):
///
///     calibration    fx fy skew cx cy baseline
///     poses          id, then T_world_camera as a 4x4 matrix, row-major; one line per frame
///     factors        frame-id landmark-id u_left u_right v X Y Z; one line per observation, (X, Y, Z) in that camera

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "../camera/pinhole.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "reprojection_data.hpp"
#include "text_reader.hpp"

namespace turbomap {

/// A sequence: frames in the order of the pose file, the first one fixed; landmarks in the order in which they are
/// first seen, placed where that first frame saw them. All observations are stereo, of sigma 1 px.
struct kitti_stereo_problem {
  mono_rig<pinhole<double>> rig;          ///< the left camera, with the baseline
  reprojection_data data;                 ///< frames, landmarks, observations
  std::vector<std::int64_t> frame_id;     ///< those of the files
  std::vector<std::int64_t> landmark_id;  ///< those of the files
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The unit quaternion of a rotation matrix [Shepperd 1978: the largest of the four is computed first].
inline rigid_transform<double> unit_quaternion(const mat3<double>& R) {
  const double trace = R(0, 0) + R(1, 1) + R(2, 2);
  double q[4];  // x y z w
  int i = 3;
  double largest = trace;
  for (int k = 0; k < 3; ++k)
    if (R(k, k) > largest) largest = R(k, k), i = k;
  if (i == 3) {
    q[3] = 1 + trace, q[0] = R(2, 1) - R(1, 2), q[1] = R(0, 2) - R(2, 0), q[2] = R(1, 0) - R(0, 1);
  } else {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    q[i] = 1 + R(i, i) - R(j, j) - R(k, k), q[j] = R(j, i) + R(i, j), q[k] = R(k, i) + R(i, k);
    q[3] = R(k, j) - R(j, k);
  }
  const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / n, q[1] / n, q[2] / n, q[3] / n, 0, 0, 0};
}

inline mono_rig<pinhole<double>> read_kitti_calibration(const std::filesystem::path& file) {
  text_reader in(file);
  pinhole<double> camera;
  camera.fx = in.take<double>("fx"), camera.fy = in.take<double>("fy");
  const auto skew = in.take<double>("skew");
  camera.cx = in.take<double>("cx"), camera.cy = in.take<double>("cy");
  const auto baseline = in.take<double>("baseline");
  if (!(camera.fx > 0) || !(camera.fy > 0)) in.fail("a focal length is not positive");
  if (skew != 0) in.fail("the skew is not 0");
  if (!(baseline > 0)) in.fail("the baseline is not positive");
  if (!std::isfinite(camera.fx * baseline)) in.fail("focal length times baseline is not finite");
  if (!in.file_ends()) in.fail("there is more than fx fy skew cx cy baseline");
  return make_mono_rig(camera, camera.fx * baseline);
}

/// One line of the poses: T_cw of T_wc. The few digits of the file leave its rotation inexact; what is returned is one.
inline rigid_transform<double> read_kitti_pose(text_reader& in) {
  double m[16];
  for (double& x : m) x = in.take<double>("element of the pose");
  const mat3<double> R{{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}};
  const mat3<double> RtR = transpose(R) * R;
  for (int i = 0; i < 9; ++i)
    if (!(std::abs(RtR.m[i] - (i % 4 == 0 ? 1 : 0)) < 1e-3)) in.fail("the pose has no rotation matrix");
  if (!(dot(cross(vec3<double>{m[0], m[1], m[2]}, {m[4], m[5], m[6]}), {m[8], m[9], m[10]}) > 0))
    in.fail("the pose is a reflection");
  if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1) in.fail("the last row of the pose is not 0 0 0 1");
  rigid_transform<double> T = unit_quaternion(transpose(R));
  const vec3<double> t = rotation(T) * vec3<double>{m[3], m[7], m[11]};
  T.tx = -t.x, T.ty = -t.y, T.tz = -t.z;
  if (!is_finite(T.tx + T.ty + T.tz)) in.fail("the position of the pose is too large");
  return T;
}

}  // namespace detail

/// Reads a sequence from its three files. Throws bad_file naming file, line and reason, also for an observation of a
/// frame without pose, a frame or an observation that comes twice, and a landmark that is first seen behind its camera.
inline kitti_stereo_problem read_kitti_stereo(const std::filesystem::path& calibration,
                                              const std::filesystem::path& poses,
                                              const std::filesystem::path& factors) {
  kitti_stereo_problem p;
  p.rig = detail::read_kitti_calibration(calibration);
  std::map<std::int64_t, std::int32_t> frames, landmarks;  // no hash: ids of a file could be made to collide
  detail::text_reader pose(poses);
  while (!pose.file_ends()) {
    const auto id = pose.take<std::int64_t>("frame id");
    if (!frames.emplace(id, static_cast<std::int32_t>(frames.size())).second)
      pose.fail("frame " + std::to_string(id) + " has a pose already");
    p.frame_id.push_back(id);
    p.data.T_cw.push_back(detail::read_kitti_pose(pose));
    p.data.fixed.push_back(p.data.fixed.empty() ? 1 : 0);
  }
  if (frames.empty()) pose.fail("there is no pose");
  detail::text_reader in(factors);
  std::set<std::int64_t> seen;  // frame and landmark
  while (!in.file_ends()) {
    const auto frame_id = in.take<std::int64_t>("frame id"), landmark_id = in.take<std::int64_t>("landmark id");
    const auto frame = frames.find(frame_id);
    if (frame == frames.end()) in.fail("frame " + std::to_string(frame_id) + " has no pose");
    const auto u = in.take<double>("u_left"), u_right = in.take<double>("u_right"), v = in.take<double>("v");
    vec3<double> x;
    x.x = in.take<double>("X"), x.y = in.take<double>("Y"), x.z = in.take<double>("Z");
    if (!in.line_ends()) in.fail("there is more than eight numbers on the line");
    const auto [landmark, is_new] = landmarks.emplace(landmark_id, static_cast<std::int32_t>(landmarks.size()));
    if (is_new) {
      if (!(x.z > 0)) in.fail("landmark " + std::to_string(landmark_id) + " is not in front of the camera");
      const auto T_cw = to_isometry<double>(p.data.T_cw[static_cast<std::size_t>(frame->second)]);
      const vec3<double> point = inverse(T_cw) * x;
      if (!detail::is_finite(point.x + point.y + point.z))
        in.fail("the position of landmark " + std::to_string(landmark_id) + " is too large");
      p.data.points.push_back(point);
      p.landmark_id.push_back(landmark_id);
    }
    const std::int64_t pair = (std::int64_t{frame->second} << 32) | landmark->second;
    if (!seen.insert(pair).second)
      in.fail("frame " + std::to_string(frame_id) + " sees landmark " + std::to_string(landmark_id) + " already");
    p.data.frame.push_back(frame->second), p.data.landmark.push_back(landmark->second);
    p.data.pixel.push_back({u, v, u_right}), p.data.information.push_back(1), p.data.stereo.push_back(1);
  }
  return p;
}

TURBOMAP_END_NAMESPACE
