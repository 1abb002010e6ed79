// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that drops new map points which fail their probation: tracking does not find them again, or no further
/// keyframe sees them [ORB-SLAM3].

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../culling/probation.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/observation_counts.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "look_again.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One round, at keyframe number `now`: erases what fails, and takes off the list what failed, died, was merged or has
/// passed. All points are checked before the first is erased: inconsistent_map leaves the map and the list as they were.
/// With a list in `faults` the contradictions are noted there instead, and the points stay until their probation is over.
/// The caller holds the guard. O(points x views).
template <class Map, class List>
map_point_culling_summary cull_recent_points(Map& map, List& recent, std::int64_t now,
                                             const map_point_culling_options& options = {}, fault_sink faults = {}) {
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  check(options);
  const auto fails = [&](const auto& r) {
    float found_ratio = 1;
    if constexpr (detail::map_has_v<Map, detail::map_found_member>) found_ratio = traits::found_ratio(map, r.point);
    return fails_probation(
        found_ratio, [&] { return !has_more_measurements(map, r.point, options.fewest_measurements); }, now - r.since,
        options);
  };
  const auto is_sound = [&](const auto& point) { return require_consistent(map, point, faults); };
  const auto at = [&](std::size_t i) -> const auto& { return recent[i].point; };
  plain_vector<std::uint8_t> failed(recent.size(), 0);
  if constexpr (!is_copy_v<Map>) {
    for_each_ahead<point_data::entry + point_data::views>(
        map, recent.size(), at, [&](std::size_t i, const auto& point) {
          failed[i] = traits::alive(map, point) && is_sound(point) && fails(recent[i]) ? 1 : 0;
        });
  } else {  // a copy has no views that cannot be looked at: what is to be erased is looked at again
    plain_vector<std::size_t> failing;
    for_each_named_ahead<0>(map, recent.size(), at, [&](std::size_t i, const auto& point) {
      look_whether_alive(map, point);
      if (traits::alive(map, point) && fails(recent[i])) failing.push_back(i);
    });
    list_of<typename traits::keyframe> alive;
    for_each_ahead<static_cast<unsigned>(point_data::views)>(
        map, failing.size(), [&](std::size_t n) -> const auto& { return at(failing[n]); },
        [&](std::size_t n, const auto& point) {
          constexpr std::size_t ahead = detail::ahead_near / 2;  // its list is there by then
          if (n + ahead < failing.size()) ask_for_slots(map, at(failing[n + ahead]));
          look_before_erasing(map, point, alive);
          failed[failing[n]] = traits::alive(map, point) && is_sound(point) && fails(recent[failing[n]]) ? 1 : 0;
        });
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
  recent.resize(kept);
  return summary;
}

/// The stage: the points on probation, and one round per keyframe. A round is short and holds the guard once: what it copies
/// is two numbers per point, and nothing is searched.
template <class Map, class Policy>
class point_culling {
 public:
  using point = typename map_traits<Map>::point;  ///< names a point

  /// Puts points on probation. \param now  number of the keyframe
  void watch(span<const point> points, std::int64_t now) {
    for (const point& p : points) recent_.push_back({p, now});
  }
  /// No point is on probation.
  void clear() { recent_.clear(); }
  /// Looks at every point on probation, under the guard; takes out of the map those that fail. \param now  number of the keyframe
  map_point_culling_summary operator()(const mapping_scope<Map, Policy>& s, std::int64_t now,
                                       const map_point_culling_options& options) {
    const auto guard = s.guard();
    return cull_recent_points(s.map, recent_, now, options, s.faults);
  }

 private:
  list_of<recent_point<point>> recent_;
};

TURBOMAP_END_NAMESPACE
