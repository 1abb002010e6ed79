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

namespace detail {

/// Which points on probation fail, where a copy of the user's map is read: it has no views that cannot be looked at, so only
/// what is to be erased is looked at again.
/// \param found_ratio  found_ratio(point)  \param fails  fails(recent point, its found ratio)  \param is_sound  is_sound(point)
/// \param failed       [i] set to 1 where recent[i] fails
template <class Map, class List, class FoundRatio, class Fails, class Sound>
void find_failing_in_copy(const Map& map, const List& recent, const FoundRatio& found_ratio, const Fails& fails,
                          const Sound& is_sound, plain_vector<std::uint8_t>& failed) {
  using traits = map_traits<Map>;
  struct failing_point {
    std::size_t at;
    float found_ratio;
  };
  plain_vector<failing_point> failing;
  const auto point_at = [&](std::size_t i) -> const auto& { return recent[i].point; };
  for_each_named_ahead<0>(map, recent.size(), point_at, [&](std::size_t i, const auto& point) {
    look_whether_alive(map, point);
    if (!traits::alive(map, point)) return;
    const float ratio = found_ratio(point);
    if (fails(recent[i], ratio)) failing.push_back({i, ratio});
  });
  list_of<typename traits::keyframe> alive;
  for_each_ahead<static_cast<unsigned>(point_data::views)>(
      map, failing.size(), [&](std::size_t n) -> const auto& { return point_at(failing[n].at); },
      [&](std::size_t n, const auto& point) {
        constexpr std::size_t soon = ahead_near / 2;  // its list is there by then
        if (n + soon < failing.size()) ask_for_slots(map, point_at(failing[n + soon].at));
        look_before_erasing(map, point, alive);
        const failing_point& f = failing[n];
        failed[f.at] = traits::alive(map, point) && is_sound(point) && fails(recent[f.at], f.found_ratio) ? 1 : 0;
      });
}

}  // namespace detail

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
  const auto found_ratio_of = [&]([[maybe_unused]] const auto& point) {
    if constexpr (detail::map_has_v<Map, detail::map_found_member>)
      return static_cast<float>(traits::found_ratio(map, point));
    else
      return 1.0f;
  };
  const auto fails = [&](const auto& r, float found_ratio) {
    return fails_probation(
        found_ratio, [&] { return !has_more_measurements(map, r.point, options.fewest_measurements); }, now - r.since,
        options);
  };
  const auto is_sound = [&](const auto& point) { return require_consistent(map, point, faults); };
  plain_vector<std::uint8_t> failed(recent.size(), 0);
  if constexpr (is_copy_v<Map>) {
    detail::find_failing_in_copy(map, recent, found_ratio_of, fails, is_sound, failed);
  } else {
    const auto at = [&](std::size_t i) -> const auto& { return recent[i].point; };
    for_each_ahead<point_data::entry + point_data::views>(
        map, recent.size(), at, [&](std::size_t i, const auto& point) {
          const bool fit = traits::alive(map, point) && is_sound(point);
          failed[i] = fit && fails(recent[i], found_ratio_of(point)) ? 1 : 0;
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

  /// Puts points on probation, but names of no point. \param now  number of the keyframe
  void watch(span<const point> points, std::int64_t now) {
    for (const point& p : points)
      if (!(p == point{})) recent_.push_back({p, now});
  }
  /// No point is on probation.
  void clear() { recent_.clear(); }
  /// Takes off the list what has passed, and judges nothing: for keyframes at which the stage is off. \param now  number of the keyframe
  void release(std::int64_t now, const map_point_culling_options& options) {
    std::size_t kept = 0;
    for (const auto& r : recent_)
      if (now - r.since < options.probation) recent_[kept++] = r;
    recent_.resize(kept);
  }
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
