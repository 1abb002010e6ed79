// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracking's part of a replay: keyframes of the log enter the map, with the associations that tracking made. Only what
/// tracking handed over is read, never the recorded results.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <turbomap/io/recording.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/math/linear.hpp>

#include "recorded_keyframes.hpp"

namespace turbomap_replay {

inline turbomap::rigid_transform<double> compose(const turbomap::rigid_transform<double>& a,
                                                 const turbomap::rigid_transform<double>& b) {
  turbomap::rigid_transform<double> c;
  c.qw = a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz;
  c.qx = a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy;
  c.qy = a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx;
  c.qz = a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw;
  const auto t = turbomap::to_isometry<double>(a) * turbomap::vec3<double>{b.tx, b.ty, b.tz};
  c.tx = t.x, c.ty = t.y, c.tz = t.z;
  return c;
}
inline turbomap::rigid_transform<double> invert(const turbomap::rigid_transform<double>& a) {
  turbomap::rigid_transform<double> b;
  b.qx = -a.qx, b.qy = -a.qy, b.qz = -a.qz, b.qw = a.qw;
  const auto t = turbomap::inverse(turbomap::to_isometry<double>(a)).t;
  b.tx = t.x, b.ty = t.y, b.tz = t.z;
  return b;
}

/// The map of a replay, addressed by the keyframe indices of the recording. What a culled keyframe saw is remembered:
/// tracking's associations name keypoints of keyframes that the recorded system still had.
/// \tparam Map  simple_map, or one with its members
template <class Map>
class replayed_map {
 public:
  using map_type = Map;
  using traits = turbomap::map_traits<map_type>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;

  /// \param chained  poses follow from the own pose of the keyframe before, as adjustments moved it
  replayed_map(const turbomap::recording& recording, bool chained)
      : recording_(recording), chained_(chained), map_(recording.meta.pyramid().levels) {}

  map_type& map() { return map_; }
  const map_type& map() const { return map_; }
  keyframe id(std::int32_t i) const { return ids_[static_cast<std::size_t>(i)]; }
  bool alive(std::int32_t i) const { return map_.alive(id(i)); }
  std::size_t size() const { return ids_.size(); }
  /// The pose of a keyframe; of a culled one, its last.
  decltype(auto) T_cw(std::int32_t i) const {  // by reference where the map gives one
    return (alive(i) ? map_.T_cw(id(i)) : last_pose_[static_cast<std::size_t>(i)]);
  }

  /// Keyframe i of the log enters the map. \param keypoints  those of the keyframe
  keyframe add(std::int32_t i, const std::vector<turbomap::keypoint>& keypoints) {
    const auto T_cw = own_pose(static_cast<std::size_t>(i));
    const std::int32_t previous = recording_.prev_kf[static_cast<std::size_t>(i)];
    const keyframe before = previous >= 0 && alive(previous) ? id(previous) : newest_alive();
    const double time_s = 1e-9 * static_cast<double>(recording_.t_ns[static_cast<std::size_t>(i)]);
    ids_.push_back(map_.add_keyframe(turbomap::span<const turbomap::keypoint>(keypoints), T_cw, time_s, before));
    remembered_.emplace_back();
    last_pose_.push_back(T_cw);
    return ids_.back();
  }

  /// Tracking's associations: keypoints that see a point of the map. As tracking does, which knows what its new keyframe sees:
  /// the points' lists are not read, unless another keypoint of it sees the point too.
  void associate(std::int32_t i) {
    seen_.clear();
    const auto range = recording_.associations(static_cast<std::size_t>(i));
    for (std::size_t row = range.begin; row < range.end; ++row) {
      if (is_new(row)) continue;
      point p = point_of(recording_.assoc_ref[row]);
      if (p == point{}) p = point_of(recording_.assoc_ref2[row]);
      ++associations_;
      if (p == point{}) continue;
      const auto keypoint = static_cast<std::size_t>(recording_.assoc_kp[row]);
      if (map_.point_at(id(i), keypoint) != point{}) continue;
      const std::uint64_t seen = traits::id(map_, p);
      if (std::find(seen_.begin(), seen_.end(), seen) == seen_.end())
        turbomap::observe_first(map_, p, id(i), keypoint), ++kept_;
      else
        kept_ += turbomap::observe(map_, p, id(i), keypoint) ? 1 : 0;
      seen_.push_back(seen);
    }
  }
  /// Associations of the log, and those whose point is in this map.
  std::size_t associations() const { return associations_; }
  std::size_t associations_kept() const { return kept_; }
  /// New stereo points of tracking: as it saw them, at the keyframe's own pose; and second views of points that are made
  /// here. Returns the points.
  const std::vector<point>& create(std::int32_t i) {
    created_.clear();
    const auto range = recording_.associations(static_cast<std::size_t>(i));
    for (std::size_t row = range.begin; row < range.end; ++row) {
      const auto at = static_cast<std::size_t>(recording_.assoc_kp[row]);
      if (!is_new(row) || map_.point_at(id(i), at) != point{}) continue;
      if (recording_.assoc_ref[row].keypoint != recording_.assoc_kp[row]) {
        const point p = point_of(recording_.assoc_ref[row]);
        if (p != point{}) turbomap::observe(map_, p, id(i), at);
        continue;
      }
      const auto T_log = turbomap::to_isometry<double>(recording_.T_cw[static_cast<std::size_t>(i)]);
      const auto in_camera = unit_ * (T_log * turbomap::cast<double>(recording_.assoc_pos[row]));
      const auto position = turbomap::inverse(turbomap::to_isometry<double>(map_.T_cw(id(i)))) * in_camera;
      const point p = map_.add_point(position, id(i));
      turbomap::observe_first(map_, p, id(i), at);
      created_.push_back(p);
    }
    return created_;
  }

  /// What tracking counted of the points on probation before this iteration.
  void count_tracking(std::int32_t i) {
    const auto range = recording_.recent(static_cast<std::size_t>(i));
    for (std::size_t row = range.begin; row < range.end; ++row) {
      const point p = point_of(recording_.recent_ref[row]);
      if (p != point{})
        map_.seen_in_tracking(p, static_cast<std::uint32_t>(recording_.recent_visible[row]),
                              static_cast<std::uint32_t>(recording_.recent_found[row]));
    }
  }

  /// The map was multiplied by this factor: what comes from the recording follows.
  void scaled(double factor) {
    unit_ *= factor;
    for (auto& T : last_pose_) T.tx *= factor, T.ty *= factor, T.tz *= factor;
  }

  /// A keyframe is about to leave the map.
  void remember(keyframe k) {
    for (std::size_t i = ids_.size(); i-- > 0;) {
      if (ids_[i] != k) continue;
      const auto count = map_.keypoints(k).size();
      for (std::size_t n = 0; n < count; ++n) remembered_[i].push_back(map_.point_at(k, n));
      last_pose_[i] = map_.T_cw(k);
      return;
    }
  }

 private:
  bool is_new(std::size_t row) const { return recording_.assoc_new[row] != 0; }

  /// Tracking's guess. With adjustment: the own pose of the keyframe before, and the recorded motion since. Without: the
  /// recorded pose. Inertial systems move their whole world a few times (events): there, poses are always chained, across a
  /// jump by the motion that the run ended with.
  turbomap::rigid_transform<double> own_pose(std::size_t i) const {
    const auto recorded = in_unit(turbomap::cast<double>(recording_.T_cw[i]));
    if (i == 0 || (recording_.meta.events.empty() && !chained_)) return recorded;
    bool jumped = false;
    for (const auto& event : recording_.meta.events)
      jumped = jumped || event.iteration + 1 == static_cast<std::int32_t>(i);
    const bool by_end = jumped && recording_.has_final();
    const auto& now = by_end ? recording_.final_T_cw[i] : recording_.T_cw[i];
    const auto& before = by_end ? recording_.final_T_cw[i - 1] : recording_.T_cw[i - 1];
    const auto motion = compose(turbomap::cast<double>(now), invert(turbomap::cast<double>(before)));
    return compose(in_unit(motion), T_cw(static_cast<std::int32_t>(i) - 1));
  }
  turbomap::rigid_transform<double> in_unit(turbomap::rigid_transform<double> T) const {
    T.tx *= unit_, T.ty *= unit_, T.tz *= unit_;
    return T;
  }
  keyframe newest_alive() const {
    for (std::size_t i = ids_.size(); i-- > 0;)
      if (map_.alive(ids_[i])) return ids_[i];
    return {};
  }
  /// The live point at a keypoint, merges followed.
  point point_of(const turbomap::keypoint_reference& ref) const {
    if (ref.keyframe < 0) return {};
    const auto k = static_cast<std::size_t>(ref.keyframe), keypoint = static_cast<std::size_t>(ref.keypoint);
    if (map_.alive(ids_[k])) return map_.point_at(ids_[k], keypoint);
    return remembered_[k].empty() ? point{} : turbomap::resolve(map_, remembered_[k][keypoint]);
  }

  const turbomap::recording& recording_;
  bool chained_;
  double unit_ = 1;  ///< of the recording, in that of the map
  map_type map_;
  std::vector<keyframe> ids_;
  std::vector<std::vector<point>> remembered_;  ///< of culled keyframes: the point of each keypoint
  std::vector<turbomap::rigid_transform<double>> last_pose_;
  std::vector<point> created_;
  std::vector<std::uint64_t> seen_;  ///< ids of points that the newest keyframe is associated with
  std::size_t associations_ = 0, kept_ = 0;
};

}  // namespace turbomap_replay
