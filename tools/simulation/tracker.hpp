// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What tracking knows of the map when it inserts a keyframe: which keypoints show which map point. Points are made
/// from stereo by the keyframe itself, or by mapping between keyframes; now and then a second one of the same scene
/// point.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <turbomap/io/recording_writer.hpp>

#include "observer.hpp"
#include "random.hpp"

namespace turbomap::simulation {

struct tracking_options {
  double tracked = 0.75;         ///< chance that a point of the map is found again where it is seen
  double created = 0.8;          ///< chance that a close stereo keypoint without a point becomes one
  double created_clutter = 0.6;  ///< the same for clutter: points that are never seen again
  double duplicated = 0.25;      ///< the same when the scene point is in the map already, but was missed
  double fused = 0.3;            ///< chance a keyframe that tracks one of two duplicates gives up the other
  double mapped = 0.5;    ///< chance that two unmapped views of a scene point become a map point (mapping's work)
  int mapped_within = 5;  ///< keyframes between those views at most
  int recent_for = 2;     ///< keyframes that a new point stays on probation
};

/// Goes through the keyframes in order. Positions are in the recording's drifting world.
class tracker {
 public:
  tracker(const simulated_rig& rig, std::size_t scene_points, const tracking_options& options, std::uint64_t seed)
      : rig_(rig), options_(options), seed_(seed), tracks_of_(scene_points), unmapped_(scene_points) {}

  struct result {
    std::vector<point_association> associations;
    std::vector<recorded_recent_point> recent;
  };

  /// The associations of keyframe i. T_wc: its pose in the drifting world. `next`: the keyframe after it, which a
  /// monocular start is made with (null otherwise). `truth[k]` receives tracking's point of every keypoint.
  result track(std::int32_t i, const keyframe_observation& seen, const Eigen::Isometry3d& T_wc,
               const std::vector<Eigen::Vector3d>& points_in_camera, const keyframe_observation* next) {
    result out;
    const std::size_t n = seen.keypoints.size();
    point_of_.emplace_back(n, -1);
    std::vector<std::int32_t> held(n, -1);
    std::vector<bool> is_new(n, false);
    for (std::size_t k = 0; k < n; ++k) held[k] = found_again(i, k, seen);
    for (std::size_t k = 0; k < n; ++k)
      if (held[k] < 0 && creates(i, k, seen, next)) {
        held[k] = create(i, k, seen.point[k], stereo_position(seen, k, T_wc, points_in_camera));
        is_new[k] = true;
        const auto partner = seen.stereo_partner[k];
        if (partner >= 0 && held[static_cast<std::size_t>(partner)] < 0)
          held[static_cast<std::size_t>(partner)] = held[k], is_new[static_cast<std::size_t>(partner)] = true;
      }
    for (std::size_t k = 0; k < n; ++k) {
      if (held[k] < 0) continue;
      const track_state& t = tracks_[static_cast<std::size_t>(held[k])];
      point_association a;
      a.keypoint = static_cast<std::int32_t>(k), a.latest = t.last, a.earliest = t.first, a.is_new = is_new[k];
      a.position = {static_cast<float>(t.position.x()), static_cast<float>(t.position.y()),
                    static_cast<float>(t.position.z())};
      out.associations.push_back(a);
      point_of_.back()[k] = held[k];
    }
    for (std::size_t k = 0; k < n; ++k)
      if (held[k] >= 0) observed(i, k, held[k]);
    out.recent = on_probation(i, seen);
    forget_duplicates(i, held);
    map_pairs(i, seen, T_wc, points_in_camera);
    return out;
  }

  /// Tracking's point of every keypoint of every keyframe so far.
  const std::vector<std::vector<std::int32_t>>& point_of() const { return point_of_; }

 private:
  struct track_state {
    std::int32_t scene_point = -1, created = 0, visible = 1, found = 1;
    keypoint_reference first, last;
    Eigen::Vector3d position;
    bool lost = false;  ///< given up: the duplicate that was kept goes on
  };

  random_stream random_for(std::int32_t i, std::size_t k, std::uint64_t what) const {
    return {seed_, purpose::tracking, static_cast<std::uint64_t>(i), k, what + 2};
  }

  std::int32_t found_again(std::int32_t i, std::size_t k, const keyframe_observation& seen) const {
    if (seen.point[k] < 0) return -1;
    std::int32_t best = -1;
    for (const std::int32_t t : tracks_of_[static_cast<std::size_t>(seen.point[k])]) {
      const track_state& state = tracks_[static_cast<std::size_t>(t)];
      if (!state.lost && (best < 0 || state.last.keyframe >= tracks_[static_cast<std::size_t>(best)].last.keyframe))
        best = t;
    }
    return best >= 0 && random_for(i, k, 0).chance(options_.tracked) ? best : -1;
  }

  bool creates(std::int32_t i, std::size_t k, const keyframe_observation& seen,
               const keyframe_observation* next) const {
    random_stream random = random_for(i, k, 1);
    if (rig_.baseline == 0)  // monocular: the first keyframe's points come from the first two views
      return next != nullptr && seen.point[k] >= 0 && random.chance(options_.created) &&
             std::find(next->point.begin(), next->point.end(), seen.point[k]) != next->point.end();
    const keypoint& p = seen.keypoints[k];
    if (!(p.depth > 0) || p.depth > rig_.close_depth) return false;
    if (seen.point[k] < 0) return random.chance(options_.created_clutter);
    std::size_t known = 0;
    for (const auto t : tracks_of_[static_cast<std::size_t>(seen.point[k])])
      known += !tracks_[static_cast<std::size_t>(t)].lost;
    return known < 2 && random.chance(known == 0 ? options_.created : options_.duplicated);
  }

  std::int32_t create(std::int32_t i, std::size_t k, std::int32_t scene_point, const Eigen::Vector3d& position) {
    const auto id = static_cast<std::int32_t>(tracks_.size());
    track_state t;
    t.scene_point = scene_point, t.created = i, t.position = position;
    t.first = t.last = {i, static_cast<std::int32_t>(k)};
    tracks_.push_back(t);
    if (scene_point >= 0) tracks_of_[static_cast<std::size_t>(scene_point)].push_back(id);
    return id;
  }

  /// As a stereo system does it: the pixel's ray to the measured depth. Monocular: the true point.
  Eigen::Vector3d stereo_position(const keyframe_observation& seen, std::size_t k, const Eigen::Isometry3d& T_wc,
                                  const std::vector<Eigen::Vector3d>& points_in_camera) const {
    const keypoint& p = seen.keypoints[k];
    if (!(p.depth > 0)) return T_wc * points_in_camera[static_cast<std::size_t>(seen.point[k])];
    const Eigen::Vector3d ray = rig_.cameras[0].unproject({p.x, p.y});
    return T_wc * Eigen::Vector3d(ray * (p.depth / ray.z()));
  }

  void observed(std::int32_t i, std::size_t k, std::int32_t t) {
    track_state& state = tracks_[static_cast<std::size_t>(t)];
    if (state.last.keyframe == i) return;  // seen by the other camera too: references are to the first view
    state.last = {i, static_cast<std::int32_t>(k)};
    ++state.found;
  }

  std::vector<recorded_recent_point> on_probation(std::int32_t i, const keyframe_observation& seen) {
    std::vector<bool> visible(tracks_of_.size(), false);
    for (const auto p : seen.point)
      if (p >= 0) visible[static_cast<std::size_t>(p)] = true;
    std::vector<recorded_recent_point> recent;
    while (first_recent_ < tracks_.size() && tracks_[first_recent_].created + options_.recent_for < i) ++first_recent_;
    for (std::size_t t = first_recent_; t < tracks_.size(); ++t) {
      track_state& state = tracks_[t];
      // A wrong point keeps projecting into the image without being found; a right one is only counted where it is
      // seen.
      if (state.created != i)
        state.visible += state.scene_point < 0 ? 5 : visible[static_cast<std::size_t>(state.scene_point)];
      state.visible = std::max(state.visible, state.found);
      recent.push_back({state.first, state.created, state.visible, state.found});
    }
    return recent;
  }

  void forget_duplicates(std::int32_t i, const std::vector<std::int32_t>& held) {
    for (std::size_t k = 0; k < held.size(); ++k) {
      if (held[k] < 0 || tracks_[static_cast<std::size_t>(held[k])].scene_point < 0) continue;
      for (const auto t : tracks_of_[static_cast<std::size_t>(tracks_[static_cast<std::size_t>(held[k])].scene_point)])
        if (t != held[k] && random_for(i, k, 2).chance(options_.fused))
          tracks_[static_cast<std::size_t>(t)].lost = true;
    }
  }

  /// Mapping makes points of scene points that two keyframes see and neither has; tracking knows them from the next one
  /// on.
  void map_pairs(std::int32_t i, const keyframe_observation& seen, const Eigen::Isometry3d& T_wc,
                 const std::vector<Eigen::Vector3d>& points_in_camera) {
    for (std::size_t k = 0; k < seen.left_count; ++k) {
      if (seen.point[k] < 0 || point_of_.back()[k] >= 0) continue;
      const auto p = static_cast<std::size_t>(seen.point[k]);
      keypoint_reference& before = unmapped_[p];
      const bool recent =
          before.keyframe >= 0 && i - before.keyframe <= options_.mapped_within &&
          point_of_[static_cast<std::size_t>(before.keyframe)][static_cast<std::size_t>(before.keypoint)] < 0;
      if (recent && tracks_of_[p].empty() && random_for(i, k, 3).chance(options_.mapped)) {
        const auto id = create(before.keyframe, static_cast<std::size_t>(before.keypoint), seen.point[k],
                               T_wc * points_in_camera[p]);
        tracks_.back().created = i;
        observed(i, k, id);
        point_of_[static_cast<std::size_t>(before.keyframe)][static_cast<std::size_t>(before.keypoint)] = id;
        point_of_.back()[k] = id;
        before = {};
      } else {
        before = {i, static_cast<std::int32_t>(k)};
      }
    }
  }

  const simulated_rig& rig_;
  tracking_options options_;
  std::uint64_t seed_;
  std::vector<track_state> tracks_;
  std::vector<std::vector<std::int32_t>> tracks_of_;  ///< by scene point
  std::vector<keypoint_reference> unmapped_;          ///< by scene point: its last view without a map point
  std::vector<std::vector<std::int32_t>> point_of_;   ///< by keyframe and keypoint
  std::size_t first_recent_ = 0;
};

}  // namespace turbomap::simulation
