// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What there is to see: a room around the path and boxes in it, with points on their faces. Boxes hide what is behind.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <vector>

#include <Eigen/Geometry>

#include "random.hpp"

namespace turbomap::simulation {

struct scene_options {
  double wall_distance = 2.0;              ///< m from the path's bounding box to the walls
  double floor_distance = 1.3;             ///< m, to floor and ceiling
  int boxes = 12;                          ///< fewer where the path leaves no room
  double box_least = 0.4, box_most = 1.4;  ///< m, side lengths
  double box_clearance = 0.5;              ///< m, least distance between a box and the path
  double ahead = 0;           ///< m: the room, and what is made to be seen, go on beyond the end of the path
  double view_distance = 25;  ///< m: a point is made to be seen from a place of the path that is no farther, if any is
};

/// A point on a surface and how it looks: from `range_max` on the finest pyramid level sees it, coarser ones from
/// nearer.
struct scene_point {
  Eigen::Vector3d position, normal, tangent;  ///< m, unit, unit: the way the patch is turned
  double range_max = 0;                       ///< m
  double strength = 0;                        ///< [0, 1): strong points are the first to become keypoints
};

class scene {
 public:
  /// A room for a path of camera centres.
  scene(const std::vector<Eigen::Vector3d>& path, const scene_options& options, std::uint64_t seed)
      : seed_(seed), view_distance_(options.view_distance) {
    for (const auto& p : path) room_.extend(p);
    const Eigen::Vector3d margin(options.wall_distance, options.wall_distance, options.floor_distance);
    room_ = {room_.min() - margin, room_.max() + margin};
    add_face_areas(room_);
    for (int i = 0; i < options.boxes; ++i) {
      random_stream random(seed, purpose::scene_boxes, static_cast<std::uint64_t>(i));
      for (int attempt = 0; attempt < 50; ++attempt) {
        Eigen::Vector3d size, corner;
        for (int a = 0; a < 3; ++a) size[a] = random.uniform(options.box_least, options.box_most);
        for (int a = 0; a < 3; ++a)
          corner[a] = random.uniform(room_.min()[a], std::max(room_.min()[a], room_.max()[a] - size[a]));
        const Eigen::AlignedBox3d box(corner, corner + size);
        const auto too_close = [&](const auto& p) { return box.exteriorDistance(p) < options.box_clearance; };
        const auto touches = [&](const auto& other) { return !box.intersection(other).isEmpty(); };
        if (std::any_of(path.begin(), path.end(), too_close) || std::any_of(boxes_.begin(), boxes_.end(), touches))
          continue;
        boxes_.push_back(box);
        add_face_areas(box);
        break;
      }
    }
    for (std::size_t i = 0; i < path.size(); i += std::max<std::size_t>(1, path.size() / 64))
      viewpoints_.push_back(path[i]);
  }

  const Eigen::AlignedBox3d& room() const { return room_; }
  const std::vector<Eigen::AlignedBox3d>& boxes() const { return boxes_; }

  /// Is `point` on a surface seen from `centre`, that is: does no box lie between?
  bool visible(const Eigen::Vector3d& centre, const Eigen::Vector3d& point) const {
    return std::none_of(boxes_.begin(), boxes_.end(), [&](const auto& box) { return hides(box, centre, point); });
  }

  /// Point number i of the scene: uniform over the faces; its scale is one that some place of the path sees at a level
  /// drawn like an extractor's features are spread, 1 / scale_factor a level.
  scene_point point(std::uint64_t i, double scale_factor, int levels) const {
    random_stream random(seed_, purpose::scene_points, i);
    const double area = random.uniform() * areas_.back();
    const auto face =
        static_cast<std::size_t>(std::upper_bound(areas_.begin(), areas_.end() - 1, area) - areas_.begin());
    const Eigen::AlignedBox3d& box = face < 6 ? room_ : boxes_[face / 6 - 1];
    const int axis = static_cast<int>(face % 6) / 2;
    const bool high = face % 2 == 1;
    scene_point p;
    for (int a = 0; a < 3; ++a) p.position[a] = random.uniform(box.min()[a], box.max()[a]);
    p.position[axis] = high ? box.max()[axis] : box.min()[axis];
    p.normal = Eigen::Vector3d::Zero();
    p.normal[axis] = (high ? 1.0 : -1.0) * (face < 6 ? -1.0 : 1.0);  // a room is seen from inside, a box from outside
    const double turn = random.uniform(0, 2 * 3.14159265358979323846);
    p.tangent = Eigen::Vector3d::Zero();
    p.tangent[(axis + 1) % 3] = std::cos(turn), p.tangent[(axis + 2) % 3] = std::sin(turn);
    const Eigen::Vector3d from = viewpoint(p.position, random);
    double weight = 0, at = 1;
    for (int o = 0; o < levels; ++o, at /= scale_factor) weight += at;
    double left = random.uniform() * weight, octave = -1;
    for (at = 1; left > 0 && octave < levels - 1; at /= scale_factor) left -= at, octave += 1;
    p.range_max = (p.position - from).norm() * std::pow(scale_factor, std::max(octave, 0.0) + random.uniform());
    p.strength = random.uniform();
    return p;
  }

 private:
  Eigen::Vector3d viewpoint(const Eigen::Vector3d& of, random_stream& random) const {
    std::vector<Eigen::Vector3d> near;
    std::copy_if(viewpoints_.begin(), viewpoints_.end(), std::back_inserter(near),
                 [&](const Eigen::Vector3d& v) { return (v - of).norm() <= view_distance_; });
    const auto& all = near.empty() ? viewpoints_ : near;
    return all[random.below(all.size())];
  }
  void add_face_areas(const Eigen::AlignedBox3d& box) {
    const Eigen::Vector3d s = box.sizes();
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side)
        areas_.push_back((areas_.empty() ? 0 : areas_.back()) + s[(axis + 1) % 3] * s[(axis + 2) % 3]);
  }

  /// Does the segment from a to b cross the box before b? (slab test; b may lie on the box's own face)
  static bool hides(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    double enter = 0, leave = 1 - 1e-6;
    for (int axis = 0; axis < 3; ++axis) {
      const double d = b[axis] - a[axis];
      if (std::abs(d) < 1e-12) {
        if (a[axis] <= box.min()[axis] || a[axis] >= box.max()[axis]) return false;
        continue;
      }
      double near = (box.min()[axis] - a[axis]) / d, far = (box.max()[axis] - a[axis]) / d;
      if (near > far) std::swap(near, far);
      enter = std::max(enter, near), leave = std::min(leave, far);
    }
    return enter < leave;
  }

  std::uint64_t seed_;
  double view_distance_;
  Eigen::AlignedBox3d room_;
  std::vector<Eigen::AlignedBox3d> boxes_;
  std::vector<double> areas_;  ///< cumulative, six faces a box, the room first
  std::vector<Eigen::Vector3d> viewpoints_;
};

}  // namespace turbomap::simulation
