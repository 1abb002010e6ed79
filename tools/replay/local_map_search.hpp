// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracking's stand-in, second part: the local map is projected into a new keyframe, and keypoints that have no point yet are
/// associated with what they show. So the map of a replay is tracked as a live system would, beside what was recorded.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <turbomap/fusion/projection_search.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/neighbourhood.hpp>
#include <turbomap/mapping/duplicate_snapshot.hpp>

namespace turbomap_replay {

/// Options of local_map_search. Defaults are those of [ORB-SLAM3]'s tracking.
struct local_map_options {
  std::size_t most_keyframes = 80;          ///< of the local map
  turbomap::neighbourhood_options choice;   ///< see the constructor
  turbomap::projection_options projection;  ///< scales are to be set
  bool covariances = false;                 ///< windows and gates know how well points are known

  local_map_options() {
    choice.min_shared_points = 1;  // every keyframe that shares a point ...
    choice.neighbours = 80;
    choice.second_neighbours = 10;  // ... and the best ten of each
  }
};

template <class Map, class Policy>
class local_map_search {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using store_type = turbomap::store_of<Map, Policy>;

  /// A keypoint that was found to show a point.
  struct association {
    std::size_t keypoint;
    point shown;
  };

  explicit local_map_search(turbomap::context<Policy>& ctx) : ctx_(ctx), found_(ctx) {}

  /// Looks for the local map in a keyframe, which must be in the store, and has its free keypoints observe what it finds.
  /// \return what was added, until the next call
  const std::vector<association>& operator()(Map& map, keyframe k, store_type& store,
                                             const turbomap::handle_table& stored, const local_map_options& options) {
    added_.clear();
    const auto& keyframes = neighbourhood_.targets(map, k, options.choice);
    points_.clear(options.covariances);
    for (std::size_t n = 0; n < std::min(keyframes.size(), options.most_keyframes); ++n)
      points_.add_points_of(map, keyframes[n]);
    selection_.clear();
    selection_.place(map, k, stored);
    points_.note_observed_by(map, k);
    taken_.clear();
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i)
      taken_.push_back(traits::point_at(map, k, i) == point{} ? 0 : 1);

    const auto pinned = store.pin(ctx_, turbomap::span<const turbomap::keyframe_handle>(selection_.handles()));
    points_.mark_observed({pinned[0].camera_count});
    const turbomap::projection_target<descriptor, camera> target{pinned[0], traits::pose(map, k), points_.skip(0),
                                                                 taken_};
    turbomap::search_by_projection(ctx_, points_.points_view(),
                                   turbomap::span<const turbomap::projection_target<descriptor, camera>>(&target, 1),
                                   options.projection, found_);
    found_.plan(ctx_, plan_);
    for (const auto& match : plan_) {
      const point p = points_.points()[static_cast<std::size_t>(match.point)];
      const auto keypoint = static_cast<std::size_t>(match.keypoint);
      if (turbomap::observe(map, p, k, keypoint)) added_.push_back({keypoint, p});
    }
    return added_;
  }

 private:
  turbomap::context<Policy>& ctx_;
  turbomap::neighbourhood<Map> neighbourhood_;
  turbomap::duplicate_snapshot<Map> points_;
  turbomap::keyframe_selection<Map> selection_;
  turbomap::projections<descriptor, camera, Policy> found_;
  typename turbomap::projections<descriptor, camera, Policy>::plan_type plan_;
  std::vector<std::uint8_t> taken_;
  std::vector<association> added_;
};

}  // namespace turbomap_replay
