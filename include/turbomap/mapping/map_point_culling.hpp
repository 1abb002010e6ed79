// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// New map points are on probation for three keyframes: those that tracking does not find again, and those that no further
/// keyframe sees, are dropped [ORB-SLAM3].

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../map/validate.hpp"

namespace turbomap {

/// Options of recent point culling. Defaults are those of [ORB-SLAM3].
struct map_point_culling_options {
  float min_found_ratio = 0.25F;  ///< found / visible in tracking below this: dropped
  int fewest_measurements = 3;    ///< so many or fewer (a stereo keypoint is two): dropped, after...
  int patience = 2;               ///< ...so many keyframes. 2 measurements where there is no stereo
  int probation = 3;              ///< keyframes after which a point is no longer looked at
};

/// A point on probation, and the keyframe it was made in, counted in keyframes that local mapping processed.
template <class Point>
struct recent_point {
  Point point;
  std::int64_t since;
};

/// What one round did.
struct map_point_culling_summary {
  std::size_t dropped = 0;   ///< erased from the map
  std::size_t released = 0;  ///< probation is over
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// One round, at keyframe number `now`: erases what fails, and takes off the list what failed, died, was merged or has
/// passed. All points are checked before the first is erased: inconsistent_map leaves the map and the list as they were.
/// The caller holds the guard. O(points x views).
template <class Map>
map_point_culling_summary cull_recent_points(Map& map,
                                             std::vector<recent_point<typename map_traits<Map>::point>>& recent,
                                             std::int64_t now, const map_point_culling_options& options = {}) {
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  require(options.min_found_ratio >= 0, "options.min_found_ratio", options.min_found_ratio, "must not be negative");
  require(options.patience >= 0, "options.patience", options.patience, "must not be negative");
  require(options.probation >= options.patience, "options.probation", options.probation,
          "must not be less than the patience");
  const auto fails = [&](const recent_point<typename traits::point>& r) {
    if constexpr (detail::map_has_v<Map, detail::map_found_member>)
      if (traits::found_ratio(map, r.point) < options.min_found_ratio) return true;
    return now - r.since >= options.patience && measurement_count(map, r.point) <= options.fewest_measurements;
  };
  std::vector<std::uint8_t> failed(recent.size(), 0);
  for (std::size_t i = 0; i < recent.size(); ++i) {
    if (!traits::alive(map, recent[i].point)) continue;
    require_consistent(map, recent[i].point);  // before its views are looked at
    failed[i] = fails(recent[i]) ? 1 : 0;
  }
  map_point_culling_summary summary;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < recent.size(); ++i) {
    const recent_point<typename traits::point> r = recent[i];
    if (!traits::alive(map, r.point)) continue;
    if (failed[i] != 0) {
      erase_point(map, r.point);
      ++summary.dropped;
    } else if (now - r.since >= options.probation) {
      ++summary.released;
    } else {
      recent[kept++] = r;
    }
  }
  recent.erase(recent.begin() + static_cast<std::ptrdiff_t>(kept), recent.end());
  return summary;
}

TURBOMAP_END_NAMESPACE
