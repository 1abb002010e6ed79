// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keypoints of two views, whose poses are known, that show the same point: nearest descriptors whose rays meet. For the two
/// cameras of a fisheye rig, and for two keyframes of one camera.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "grid_features.hpp"
#include "simulation/descriptors.hpp"
#include "simulation/rig.hpp"

namespace turbomap::extraction {

struct view_pair_options {
  std::uint32_t most_different = 50;  ///< bits of 256 [ORB-SLAM3, search of new points]
  double second_best = 0.8;           ///< the best is so much nearer than the second (Lowe, IJCV 2004)
  double pixels = 2;                  ///< error of a reprojection at most, times the level's scale: about 2.5 sigma
  double parallax = 0.01;  ///< rad between the rays at least: depth is known to a tenth then, with 0.2 px and f 200 px
};

/// Keypoint `a` of the first view and `b` of the second, and the point in the first camera.
struct view_pair {
  std::int32_t a, b;
  Eigen::Vector3d point;
};

/// The middle of the shortest line between two rays: the point in the frame of a. False when they are parallel, or meet behind
/// one of the views.
inline bool meet(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b_in_a, const Eigen::Vector3d& centre_b_in_a,
                 double parallax, Eigen::Vector3d& point) {
  const Eigen::Vector3d normal = ray_a.cross(ray_b_in_a);
  if (!(normal.norm() > std::sin(parallax))) return false;
  const double along_a = centre_b_in_a.cross(ray_b_in_a).dot(normal) / normal.squaredNorm();
  const double along_b = centre_b_in_a.cross(ray_a).dot(normal) / normal.squaredNorm();
  if (!(along_a > 0) || !(along_b > 0)) return false;
  point = 0.5 * (along_a * ray_a + centre_b_in_a + along_b * ray_b_in_a);
  return true;
}

/// One of two views. Keypoints that hold a point are in no pair.
struct paired_view {
  const image_features& features;
  const simulation::simulated_camera& camera;
  const std::vector<std::int32_t>* held = nullptr;  ///< the point of each keypoint, -1: none; null: none holds one

  bool is_free(std::size_t keypoint) const { return held == nullptr || (*held)[keypoint] < 0; }
};

/// The pairs in the order of a; each keypoint is in one at most.
inline std::vector<view_pair> view_pairs(const paired_view& view_a, const paired_view& view_b,
                                         const Eigen::Isometry3d& T_ab, float scale_factor,
                                         const view_pair_options& options) {
  struct best_of_b {
    std::int32_t a = -1;
    std::uint32_t distance = std::numeric_limits<std::uint32_t>::max();
    Eigen::Vector3d point;
  };
  const image_features &a = view_a.features, &b = view_b.features;
  const Eigen::Isometry3d T_ba = T_ab.inverse();
  const auto pixel = [](const keypoint& k) { return Eigen::Vector2d(k.x, k.y); };
  std::vector<Eigen::Vector3d> rays_b;
  for (const keypoint& k : b.keypoints) rays_b.push_back(T_ab.linear() * view_b.camera.unproject(pixel(k)));
  std::vector<best_of_b> taken(b.keypoints.size());
  for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
    if (!view_a.is_free(i)) continue;
    std::uint32_t best = 257, second = 257;  // more bits than a descriptor has: none yet
    std::size_t at = 0;
    for (std::size_t j = 0; j < b.keypoints.size(); ++j) {
      if (!view_b.is_free(j)) continue;
      const std::uint32_t d = simulation::hamming(a.descriptors[i], b.descriptors[j]);
      if (d < best)
        second = best, best = d, at = j;
      else if (d < second)
        second = d;
    }
    if (best > options.most_different || best > options.second_best * second || best >= taken[at].distance) continue;
    Eigen::Vector3d point;
    if (!meet(view_a.camera.unproject(pixel(a.keypoints[i])), rays_b[at], T_ab.translation(), options.parallax, point))
      continue;
    const auto fits = [&](const simulation::simulated_camera& camera, const Eigen::Vector3d& x, const keypoint& k) {
      Eigen::Vector2d seen;
      return camera.project(x, seen) &&
             (seen - pixel(k)).norm() <= options.pixels * std::pow(static_cast<double>(scale_factor), k.octave);
    };
    if (!fits(view_a.camera, point, a.keypoints[i]) || !fits(view_b.camera, T_ba * point, b.keypoints[at])) continue;
    taken[at] = {static_cast<std::int32_t>(i), best, point};
  }
  std::vector<view_pair> pairs;
  for (std::size_t j = 0; j < taken.size(); ++j)
    if (taken[j].a >= 0) pairs.push_back({taken[j].a, static_cast<std::int32_t>(j), taken[j].point});
  std::sort(pairs.begin(), pairs.end(), [](const view_pair& x, const view_pair& y) { return x.a < y.a; });
  return pairs;
}

}  // namespace turbomap::extraction
