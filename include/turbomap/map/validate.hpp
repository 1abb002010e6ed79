// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether a map keeps the invariants of map_edit.hpp. validate(map) looks at all of it and lists what is wrong; commits look at
/// what they are about to touch, and refuse.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/rotation.hpp"
#include "../plain_vector.hpp"
#include "map_fault.hpp"
#include "map_traits.hpp"
#include "observation_counts.hpp"
#include "read_ahead.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Calls report(violation) for each observation of a live point that its keyframe contradicts. True if keyframes,
/// keypoints and octaves may be read. O(views).
template <class Map, class Report>
bool check_observations(const Map& map, typename map_traits<Map>::point point, Report report) {
  using traits = map_traits<Map>;
  const std::uint64_t id = traits::id(map, point);
  bool readable = true;  // keyframes and keypoints are there: the rest may be asked for
  traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
    const auto fault = [&](map_fault f) { report(map_violation{f, traits::id(map, k), id, i}); };
    if (k == typename traits::keyframe{} || !traits::alive(map, k)) {
      report(map_violation{map_fault::observer_not_alive, 0, id, i});
      readable = false;
      return;
    }
    if (i >= keypoint_count_of(map, k)) {
      fault(map_fault::keypoint_out_of_range);
      readable = false;
      return;
    }
    if (!(traits::point_at(map, k, i) == point)) fault(map_fault::observation_without_slot);
    if constexpr (users_counts_v<Map>) {
      if (keypoint_of(map, k, i).octave >= traits::octave_counts(map, point).size()) {
        fault(map_fault::octave_out_of_range);
        readable = false;
      }
    }
  });
  return readable;
}

/// All faults of a live point. O(views^2).
template <class Map, class Report>
void check_point(const Map& map, typename map_traits<Map>::point point, Report report) {
  using traits = map_traits<Map>;
  if (!check_observations(map, point, report)) return;
  const std::uint64_t id = traits::id(map, point);
  std::size_t place = 0;
  traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
    const int camera = keypoint_of(map, k, i).camera;
    bool twice = false;
    std::size_t other = 0;
    traits::for_each_observation(map, point, [&](typename traits::keyframe l, std::size_t j) {
      twice = twice || (other++ > place && l == k && keypoint_of(map, l, j).camera == camera);
    });
    if (twice) report(map_violation{map_fault::seen_twice_by_camera, traits::id(map, k), id, i});
    ++place;
  });
  if constexpr (counts_octaves_v<Map>) {
    const auto kept = traits::octave_counts(map, point);
    plain_vector<std::uint32_t> truth;
    recount(map, point, truth, kept.size());
    for (std::size_t o = 0; o < truth.size(); ++o)
      if (o >= kept.size() || kept[o] != truth[o])
        return report(map_violation{map_fault::wrong_octave_counts, 0, id, 0});
  }
}

/// The same for one slot of a live keyframe.
template <class Map, class Report>
void check_slot(const Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t keypoint, Report report) {
  using traits = map_traits<Map>;
  const auto point = traits::point_at(map, keyframe, keypoint);
  if (point == typename traits::point{}) return;
  const auto fault = [&](map_fault f, std::uint64_t id) {
    report(map_violation{f, traits::id(map, keyframe), id, keypoint});
  };
  if (!traits::alive(map, point)) return fault(map_fault::slot_of_dead_point, 0);
  bool listed = false;
  traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
    listed = listed || (k == keyframe && i == keypoint);
  });
  if (!listed) fault(map_fault::slot_without_observation, traits::id(map, point));
}

}  // namespace detail

/// Whether the position of a point is made of numbers.
template <class Map>
bool has_finite_position(const Map& map, typename map_traits<Map>::point point) {
  const auto& x = map_traits<Map>::position(map, point);
  return detail::is_finite(x.x) && detail::is_finite(x.y) && detail::is_finite(x.z);
}

/// Every fault of the map, keyframes first, in the order of the map. Needs for_each_keyframe and for_each_point of the
/// traits. Takes no guard: hold it. O(slots + observations x views).
template <class Map>
std::vector<map_violation> validate(const Map& map) {
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  static_assert(detail::map_has_v<Map, detail::map_all_member>,
                "turbomap: validate() needs map_traits with for_each_keyframe and for_each_point; see docs/map.md");
  std::vector<map_violation> faults;
  const auto report = [&](const map_violation& v) { faults.push_back(v); };
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    if (!traits::alive(map, k)) return;
    if (!is_pose(pose_of(map, k))) report(map_violation{map_fault::bad_pose, traits::id(map, k), 0, 0});
    for (std::size_t i = 0; i < keypoint_count_of(map, k); ++i) detail::check_slot(map, k, i, report);
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    if (!traits::alive(map, p)) return;
    if (!has_finite_position(map, p)) report(map_violation{map_fault::position_not_finite, 0, traits::id(map, p), 0});
    detail::check_point(map, p, report);
  });
  return faults;
}

/// Whether no keyframe contradicts an observation of the point. By default throws inconsistent_map where one does. O(views).
template <class Map>
bool require_consistent(const Map& map, typename map_traits<Map>::point point, fault_sink faults = {}) {
  bool sound = true;
  detail::check_observations(map, point, [&](const map_violation& v) { faults(v), sound = false; });
  return sound;
}

/// Whether a slot agrees with the point in it. By default throws inconsistent_map where it does not. O(views).
template <class Map>
bool require_consistent_slot(const Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t keypoint,
                             fault_sink faults = {}) {
  bool sound = true;
  detail::check_slot(map, keyframe, keypoint, [&](const map_violation& v) { faults(v), sound = false; });
  return sound;
}

/// Both, for all slots of a live keyframe. O(views of its points).
template <class Map>
bool require_consistent_keyframe(const Map& map, typename map_traits<Map>::keyframe keyframe, fault_sink faults = {}) {
  using traits = map_traits<Map>;
  bool sound = true;
  for_each_slot_ahead<point_data::entry + point_data::views>(map, keyframe, [&](std::size_t i, const auto& point) {
    if (point == typename traits::point{}) return;
    if (!require_consistent_slot(map, keyframe, i, faults)) sound = false;
    if (traits::alive(map, point) && !require_consistent(map, point, faults)) sound = false;
  });
  return sound;
}

/// Whether a live keyframe can be taken out as erase_keyframe() does it: its slots agree with the points in them, and what else
/// the removal reads or writes is sound. That is all of a point that is left with `fewest` views or fewer, so may be erased; of one
/// that lives on, the keyframe's own views, that all observers are alive and have the keypoints. By default throws
/// inconsistent_map. O(views of its points).
/// \param begin,end  of the keypoints of a part of the removal: fade_keypoints()
template <class Map>
bool require_removable(const Map& map, typename map_traits<Map>::keyframe keyframe, int fewest, fault_sink faults,
                       std::size_t begin, std::size_t end) {
  using traits = map_traits<Map>;
  const std::size_t keypoints = keypoint_count_of(map, keyframe);
  bool sound = true;
  const auto at = [&](std::size_t n) { return traits::point_at(map, keyframe, begin + n); };
  for_each_ahead<point_data::entry + point_data::views>(map, end - begin, at, [&](std::size_t n, const auto& point) {
    if (point == typename traits::point{}) return;
    const std::size_t slot = begin + n;
    const auto is_sound_own = [&](std::size_t i) {
      if (i >= keypoints || !(traits::point_at(map, keyframe, i) == point)) return false;
      if constexpr (detail::users_counts_v<Map>)
        return keypoint_of(map, keyframe, i).octave < traits::octave_counts(map, point).size();
      return true;
    };
    bool listed = false, suspect = false;
    int left = 0;  // other views: one measurement each, at least
    if (traits::alive(map, point))
      traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
        if (k == keyframe)
          listed = listed || i == slot, suspect = suspect || !is_sound_own(i);
        else if (k == typename traits::keyframe{} || !traits::alive(map, k) || i >= keypoint_count_of(map, k))
          suspect = true;  // any of these may be asked for once the own view is gone
        else
          ++left;
      });
    if (!listed) sound = require_consistent_slot(map, keyframe, slot, faults) && sound;
    if (traits::alive(map, point) && (suspect || left <= fewest))
      sound = require_consistent(map, point, faults) && sound;
  });
  return sound;
}
/// The same of all its keypoints.
template <class Map>
bool require_removable(const Map& map, typename map_traits<Map>::keyframe keyframe, int fewest,
                       fault_sink faults = {}) {
  return require_removable(map, keyframe, fewest, faults, 0, keypoint_count_of(map, keyframe));
}

TURBOMAP_END_NAMESPACE
