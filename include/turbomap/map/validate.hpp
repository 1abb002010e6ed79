// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether a map keeps the invariants of map_edit.hpp. validate(map) looks at all of it and lists what is wrong; commits look at
/// what they are about to touch, and refuse.

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "map_traits.hpp"
#include "observation_counts.hpp"

namespace turbomap {

/// What is wrong with a map.
enum class map_fault : std::uint8_t {
  slot_of_dead_point,        ///< a slot holds a point that is not alive
  slot_without_observation,  ///< a slot holds a point that does not list this keypoint
  observation_without_slot,  ///< an observation whose slot is empty or holds another point
  observer_not_alive,        ///< an observation by a keyframe that is not in the map
  keypoint_out_of_range,     ///< an observation by a keypoint that the keyframe does not have
  seen_twice_by_camera,      ///< two keypoints of one camera of a keyframe see the point
  octave_out_of_range,       ///< a keypoint's octave is beyond the counts of the point
  wrong_octave_counts        ///< the counts differ from recount()
};

inline const char* to_string(map_fault fault) {
  switch (fault) {
    case map_fault::slot_of_dead_point:
      return "a slot holds a point that is not alive";
    case map_fault::slot_without_observation:
      return "a slot holds a point that does not list the keypoint";
    case map_fault::observation_without_slot:
      return "an observation whose slot does not hold the point";
    case map_fault::observer_not_alive:
      return "an observation by a keyframe that is not alive";
    case map_fault::keypoint_out_of_range:
      return "an observation by a keypoint that the keyframe does not have";
    case map_fault::seen_twice_by_camera:
      return "a camera sees the point by two keypoints";
    case map_fault::octave_out_of_range:
      return "an octave beyond the counts of the point";
    case map_fault::wrong_octave_counts:
      return "the counts by octave differ from the observations";
  }
  return "";
}

/// One fault, with the ids of keyframe and point (0 where it is about a point alone) and the keypoint.
struct map_violation {
  map_fault fault;
  std::uint64_t keyframe;
  std::uint64_t point;
  std::size_t keypoint;
};

inline std::string to_string(const map_violation& v) {
  std::string text = to_string(v.fault);
  text.append(": keyframe ").append(printed(v.keyframe)).append(", keypoint ").append(printed(v.keypoint));
  return text.append(", point ").append(printed(v.point));
}

/// A commit was refused because the part of the map that it concerns contradicts itself; the map is unchanged.
struct inconsistent_map : std::invalid_argument {
  explicit inconsistent_map(const map_violation& v)
      : std::invalid_argument(std::string("turbomap: map: ").append(to_string(v))), violation(v) {}
  map_violation violation;
};

}  // namespace turbomap

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
    if constexpr (counts_octaves_v<Map>) {
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
    for (std::size_t i = 0; i < keypoint_count_of(map, k); ++i) detail::check_slot(map, k, i, report);
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    if (traits::alive(map, p)) detail::check_point(map, p, report);
  });
  return faults;
}

/// Throws inconsistent_map when a keyframe contradicts an observation of the point. O(views).
template <class Map>
void require_consistent(const Map& map, typename map_traits<Map>::point point) {
  detail::check_observations(map, point, [](const map_violation& v) { throw inconsistent_map(v); });
}

/// Throws inconsistent_map when a slot does not agree with the point in it. O(views).
template <class Map>
void require_consistent_slot(const Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t keypoint) {
  detail::check_slot(map, keyframe, keypoint, [](const map_violation& v) { throw inconsistent_map(v); });
}

/// Both, for all slots of a live keyframe. O(views of its points).
template <class Map>
void require_consistent_keyframe(const Map& map, typename map_traits<Map>::keyframe keyframe) {
  using traits = map_traits<Map>;
  const std::size_t keypoints = keypoint_count_of(map, keyframe);
  for (std::size_t i = 0; i < keypoints; ++i) {
    require_consistent_slot(map, keyframe, i);
    const auto point = traits::point_at(map, keyframe, i);
    if (!(point == typename traits::point{})) require_consistent(map, point);
  }
}

TURBOMAP_END_NAMESPACE
