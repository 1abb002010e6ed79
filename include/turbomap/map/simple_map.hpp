// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A plain map of our own: keyframes with slots, points with observations, everything an index, no pointers. For the
/// examples, the replay and for users who have no map of theirs.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../types.hpp"

namespace turbomap {

/// A keypoint of a keyframe of the map.
struct observation {
  std::int32_t keyframe;
  std::int32_t keypoint;
};

/// A keyframe and how many points it shares with another.
struct covisible_keyframe {
  std::int32_t keyframe;
  std::int32_t shared_points;
};

/// Keyframes and points in the order of their insertion. Not synchronised: one writer, or the caller's lock.
class simple_map {
 public:
  static constexpr std::int32_t none = -1;

  /// Adds a keyframe of `keypoints` empty slots. Returns its index. Throws std::invalid_argument for a negative number.
  std::int32_t add_keyframe(int keypoints, const rigid_transform<double>& T_cw) {
    require(keypoints >= 0, "keypoints", keypoints, "must not be negative");
    slots_.emplace_back(static_cast<std::size_t>(keypoints), none);
    T_cw_.push_back(T_cw);
    return static_cast<std::int32_t>(slots_.size()) - 1;
  }

  /// Adds a point (world, m) without observations. Returns its index.
  std::int32_t add_point(const vec3<double>& position) {
    positions_.push_back(position);
    observations_.emplace_back();
    return static_cast<std::int32_t>(positions_.size()) - 1;
  }

  /// Records that `keypoint` of `keyframe` sees `point`. False, and nothing is changed, where the slot holds a point
  /// already, or the point is observed in this keyframe already by a keypoint for which same_camera(keypoint, it) holds: a
  /// point is seen once by one camera. Throws std::invalid_argument for an index out of range.
  template <class SameCamera>
  bool observe(std::int32_t point, std::int32_t keyframe, std::int32_t keypoint, SameCamera same_camera) {
    check_keypoint(keyframe, keypoint);
    require(point >= 0 && static_cast<std::size_t>(point) < positions_.size(), "point", point,
            "is not a point of the map");
    std::int32_t& slot = slots_[static_cast<std::size_t>(keyframe)][static_cast<std::size_t>(keypoint)];
    if (slot != none) return false;
    auto& seen = observations_[static_cast<std::size_t>(point)];
    for (const observation& o : seen)
      if (o.keyframe == keyframe && same_camera(o.keypoint, keypoint)) return false;
    seen.push_back({keyframe, keypoint});  // may throw: first
    slot = point;
    return true;
  }
  bool observe(std::int32_t point, std::int32_t keyframe, std::int32_t keypoint) {
    return observe(point, keyframe, keypoint, [](std::int32_t, std::int32_t) { return true; });
  }

  /// The point that a keypoint sees, or none. Throws std::invalid_argument for an index out of range.
  std::int32_t point_at(std::int32_t keyframe, std::int32_t keypoint) const {
    check_keypoint(keyframe, keypoint);
    return slots_[static_cast<std::size_t>(keyframe)][static_cast<std::size_t>(keypoint)];
  }

  std::size_t keyframe_count() const { return slots_.size(); }
  std::size_t point_count() const { return positions_.size(); }
  const rigid_transform<double>& T_cw(std::int32_t keyframe) const {
    return T_cw_.at(static_cast<std::size_t>(keyframe));
  }
  const vec3<double>& position(std::int32_t point) const { return positions_.at(static_cast<std::size_t>(point)); }
  const std::vector<observation>& observations(std::int32_t point) const {
    return observations_.at(static_cast<std::size_t>(point));
  }
  /// One entry a keypoint: its point or none.
  const std::vector<std::int32_t>& slots(std::int32_t keyframe) const {
    return slots_.at(static_cast<std::size_t>(keyframe));
  }

  /// Marks the keypoints of a keyframe that see a point: the mask a correspondence search takes.
  void has_point(std::int32_t keyframe, std::vector<std::uint8_t>& mask) const {
    const auto& points = slots(keyframe);
    mask.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) mask[i] = points[i] != none;
  }

  /// Keyframes that share points with this one, most shared first, equal ones by index. A point counts once a keyframe.
  /// O(observations of its points).
  std::vector<covisible_keyframe> covisible(std::int32_t keyframe) const {
    std::vector<std::int32_t> shared(slots_.size(), 0);
    std::vector<std::int32_t> points;
    for (const std::int32_t p : slots(keyframe))
      if (p != none) points.push_back(p);
    std::sort(points.begin(), points.end());  // a rig sees a point in two slots
    points.erase(std::unique(points.begin(), points.end()), points.end());
    for (const std::int32_t p : points) {
      const auto& seen = observations_[static_cast<std::size_t>(p)];
      for (std::size_t i = 0; i < seen.size(); ++i) {
        bool first = true;
        for (std::size_t k = 0; k < i; ++k) first = first && seen[k].keyframe != seen[i].keyframe;
        if (first) ++shared[static_cast<std::size_t>(seen[i].keyframe)];
      }
    }
    std::vector<covisible_keyframe> result;
    for (std::size_t k = 0; k < shared.size(); ++k)
      if (shared[k] > 0 && k != static_cast<std::size_t>(keyframe))
        result.push_back({static_cast<std::int32_t>(k), shared[k]});
    std::stable_sort(result.begin(), result.end(), [](const covisible_keyframe& a, const covisible_keyframe& b) {
      return a.shared_points > b.shared_points;
    });
    return result;
  }

 private:
  void check_keypoint(std::int32_t keyframe, std::int32_t keypoint) const {
    require(keyframe >= 0 && static_cast<std::size_t>(keyframe) < slots_.size(), "keyframe", keyframe,
            "is not a keyframe of the map");
    require(keypoint >= 0 && static_cast<std::size_t>(keypoint) < slots_[static_cast<std::size_t>(keyframe)].size(),
            "keypoint", keypoint, "is not a keypoint of the keyframe");
  }

  std::vector<std::vector<std::int32_t>> slots_;
  std::vector<rigid_transform<double>> T_cw_;
  std::vector<vec3<double>> positions_;
  std::vector<std::vector<observation>> observations_;
};

}  // namespace turbomap
