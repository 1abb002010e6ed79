// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How often a point is observed: by octave (which makes redundancy a short sum, [TurboMap §IV-F]) and in all. A keyframe
/// counts once in the octaves, at the finest at which any camera of its rig sees the point. map_edit.hpp keeps the counts
/// with every observation added, moved or erased; recount() computes them from the observations alone.

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The finest octave at which a keyframe sees the point, leaving out its keypoint `except`; -1 where it does not. O(views).
template <class Map>
int finest_octave(const Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::keyframe keyframe,
                  std::size_t except = static_cast<std::size_t>(-1)) {
  using traits = map_traits<Map>;
  int finest = -1;
  traits::for_each_observation(map, point, [&](typename traits::keyframe observer, std::size_t keypoint) {
    if (!(observer == keyframe) || keypoint == except) return;
    const int octave = keypoint_of(map, observer, keypoint).octave;
    if (finest < 0 || octave < finest) finest = octave;
  });
  return finest;
}

/// The keypoint by which camera `camera` of a keyframe sees the point, or -1. O(views).
template <class Map>
std::ptrdiff_t observed_at(const Map& map, typename map_traits<Map>::point point,
                           typename map_traits<Map>::keyframe keyframe, int camera) {
  using traits = map_traits<Map>;
  std::ptrdiff_t found = -1;
  traits::for_each_observation(map, point, [&](typename traits::keyframe observer, std::size_t keypoint) {
    if (observer == keyframe && keypoint_of(map, observer, keypoint).camera == camera)
      found = static_cast<std::ptrdiff_t>(keypoint);
  });
  return found;
}

/// Observers per octave from the observations alone: the truth that kept counts must equal. Resized to hold the coarsest
/// octave seen, and at least to `octaves`. O(views^2).
template <class Map, class List>
void recount(const Map& map, typename map_traits<Map>::point point, List& counts, std::size_t octaves = 0) {
  using traits = map_traits<Map>;
  counts.assign(octaves, 0);
  traits::for_each_observation(map, point, [&](typename traits::keyframe observer, std::size_t keypoint) {
    const int octave = keypoint_of(map, observer, keypoint).octave;
    const int other = finest_octave(map, point, observer, keypoint);
    // Of a rig's views the finest counts; of equal ones that with the lowest keypoint.
    if (other >= 0 && other < octave) return;
    if (other == octave) {
      bool first = true;
      traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
        first = first && !(k == observer && i < keypoint && keypoint_of(map, k, i).octave == octave);
      });
      if (!first) return;
    }
    if (counts.size() <= static_cast<std::size_t>(octave)) counts.resize(static_cast<std::size_t>(octave) + 1);
    ++counts[static_cast<std::size_t>(octave)];
  });
}

/// Whether the observations of points are counted by their octaves in the user's map.
template <class Map>
inline constexpr bool counts_octaves_v = detail::map_has_v<Map, detail::map_counts_member>;

namespace detail {
/// The same, where the counts are the user's. A copy of a map that has none counts by itself, and its traits say `users_counts =
/// false`: such counts have room for every octave, and end with their point.
template <class Map, class = void>
inline constexpr bool users_counts_v = counts_octaves_v<Map>;
template <class Map>
inline constexpr bool users_counts_v<Map, std::void_t<decltype(map_traits<Map>::users_counts)>> =
    map_traits<Map>::users_counts;
}  // namespace detail

/// The number of measurements of a point: a stereo keypoint (u_right >= 0) is two, every other view one [ORB-SLAM3]. O(views).
template <class Map>
int measurement_count(const Map& map, typename map_traits<Map>::point point) {
  using traits = map_traits<Map>;
  if constexpr (detail::map_has_v<Map, detail::map_measurements_member>) {
    return traits::kept_measurements(map, point);
  } else {
    int count = 0;
    traits::for_each_observation(map, point, [&](typename traits::keyframe observer, std::size_t keypoint) {
      count += keypoint_of(map, observer, keypoint).u_right >= 0 ? 2 : 1;
    });
    return count;
  }
}

/// Whether measurement_count() is more than `fewest`. Keypoints are read of points with so few views only: each view is one
/// measurement at least, and keypoints of other keyframes are far away in memory.
template <class Map>
bool has_more_measurements(const Map& map, typename map_traits<Map>::point point, int fewest) {
  using traits = map_traits<Map>;
  if constexpr (detail::map_has_v<Map, detail::map_measurements_member>)
    return traits::kept_measurements(map, point) > fewest;
  int views = 0;
  traits::for_each_observation(map, point, [&](typename traits::keyframe, std::size_t) { ++views; });
  return views > fewest || measurement_count(map, point) > fewest;
}

TURBOMAP_END_NAMESPACE
