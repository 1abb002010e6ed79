// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the oracles of the correspondence search and of point creation share: poses, rays and triangulation as a textbook
/// has them, in Eigen and plain double. Nothing here uses the library's own geometry, only its data and camera models.

#include <turbomap/camera/camera_concept.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/matching/search_options.hpp>
#include <turbomap/store/posed_keyframe.hpp>
#include <turbomap/types.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "eigen.hpp"

namespace turbomap_test {

/// Compares, and remembers whether a comparison was so close that rounding may turn it: then the oracle's answer is one
/// of two.
struct close_calls {
  static constexpr double relative = 1e-9;
  bool any = false;

  /// a < b, where both are of the order of `scale` at least.
  bool less(double a, double b, double scale = 0) {
    any = any || !(std::abs(a - b) > relative * std::max({std::abs(a), std::abs(b), scale}));
    return a < b;
  }
  bool at_most(double a, double b, double scale = 0) { return !less(b, a, scale); }
};

/// x_to = R x_from + t.
struct oracle_pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return R * x + t; }
  oracle_pose operator*(const oracle_pose& b) const { return {R * b.R, R * b.t + t}; }
  oracle_pose inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
  Eigen::Matrix<double, 3, 4> matrix() const { return (Eigen::Matrix<double, 3, 4>() << R, t).finished(); }
};

/// The quaternion as stored, like the recorded peer, but for one that is no rotation's by more than rounding.
inline oracle_pose to_oracle_pose(const turbomap::rigid_transform<double>& T) {
  Eigen::Quaterniond q(T.qw, T.qx, T.qy, T.qz);
  if (std::abs(q.squaredNorm() - 1) > 1e-6) q.normalize();
  return {q.toRotationMatrix(), {T.tx, T.ty, T.tz}};
}

/// World to camera `k` of a keyframe's rig.
template <class Descriptor, class Camera>
oracle_pose oracle_camera_pose(const turbomap::posed_keyframe<Descriptor, Camera>& keyframe, int k) {
  return to_oracle_pose(keyframe.view.cameras[k].T_camera_body) * to_oracle_pose(keyframe.T_cw);
}

/// scale_factor^octave, by multiplication in float: the tables of the recorded peer.
inline float oracle_scale(const turbomap::pyramid& pyramid, int octave) {
  float scale = 1;
  for (int o = 0; o < octave; ++o) scale *= pyramid.scale_factor;
  return scale;
}
inline float oracle_sigma2(const turbomap::pyramid& pyramid, int octave) {
  const float scale = oracle_scale(pyramid, octave);
  return scale * scale;
}

/// Does the model say that it is a pinhole? Then also its matrix.
template <class Camera>
bool pinhole_matrix(const Camera& camera, Eigen::Matrix3d& K) {
  turbomap::pinhole<double> p;
  if (!turbomap::as_pinhole(camera, p)) return false;
  K << p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1;
  return true;
}

template <class Camera>
bool oracle_project(const Camera& camera, const Eigen::Vector3d& x, Eigen::Vector2d& pixel) {
  turbomap::vec2<double> p;
  if (!camera.project(turbomap::vec3<double>{x.x(), x.y(), x.z()}, p)) return false;
  pixel = {p.x, p.y};
  return true;
}

template <class View>
Eigen::Vector2d pixel_of(const View& view, int keypoint) {
  return {view.pixel[keypoint].x, view.pixel[keypoint].y};
}
template <class View>
Eigen::Vector3d bearing_of(const View& view, int keypoint) {
  return {view.bearing[keypoint].x, view.bearing[keypoint].y, view.bearing[keypoint].z};
}

TURBOMAP_TEST_EIGEN_BEGIN
/// Hartley & Zisserman 12.2: each ray gives two rows, the point is the null vector. A ray that points forward is scaled to
/// z = 1. False where the point has no finite position. `shaky`: the null vector is not well defined.
inline bool oracle_triangulate(const oracle_pose& T_a, Eigen::Vector3d ray_a, const oracle_pose& T_b,
                               Eigen::Vector3d ray_b, Eigen::Vector3d& point, bool& shaky) {
  if (ray_a.z() > 0) ray_a /= ray_a.z();
  if (ray_b.z() > 0) ray_b /= ray_b.z();
  const Eigen::Matrix<double, 3, 4> P_a = T_a.matrix(), P_b = T_b.matrix();
  Eigen::Matrix4d A;
  A.row(0) = ray_a.x() * P_a.row(2) - ray_a.z() * P_a.row(0);
  A.row(1) = ray_a.y() * P_a.row(2) - ray_a.z() * P_a.row(1);
  A.row(2) = ray_b.x() * P_b.row(2) - ray_b.z() * P_b.row(0);
  A.row(3) = ray_b.y() * P_b.row(2) - ray_b.z() * P_b.row(1);
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(A, Eigen::ComputeFullV);
  const Eigen::Vector4d h = svd.matrixV().col(3);
  const auto& s = svd.singularValues();
  shaky = !(s[2] > 1e-5 * s[0]);
  if (h[3] == 0) return false;
  point = h.head<3>() / h[3];
  return true;
}
TURBOMAP_TEST_EIGEN_END

/// Group of every keypoint, from the lists by group.
template <class View>
std::vector<std::uint32_t> groups_of(const View& view) {
  std::vector<std::uint32_t> group(static_cast<std::size_t>(view.keypoint_count), turbomap::keypoint::no_group);
  for (int g = 0; g < view.groups.group_count; ++g)
    for (std::uint32_t i = view.groups.offsets[static_cast<std::size_t>(g)];
         i < view.groups.offsets[static_cast<std::size_t>(g) + 1]; ++i)
      group[view.groups.keypoints[i]] = view.groups.ids[g];
  return group;
}

/// One result, of a neighbour and a query keypoint, that hung on a close call.
struct doubtful_result {
  std::int32_t neighbour, query;
};

}  // namespace turbomap_test
