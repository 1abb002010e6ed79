// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Finds what a map_mirror holds and nobody has reported as changed. At each keyframe a sample is compared with the user's map, the
/// next part at each call, so that every point and keyframe has its turn. What differs is read anew.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/read_ahead.hpp"
#include "../types.hpp"
#include "map_copy.hpp"
#include "prefetch_named.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// How a point that was read compares with the user's map.
enum class point_state { current, awaits_keyframe, stale };

/// Compares a point that was read with the user's map; the order of observations does not count. The caller holds the guard.
/// \param p  its place
/// \return awaits_keyframe: all that is missing are views of keyframes whose slots have not been read. Tracking adds those while the
///         keyframe waits for its turn, and need not report them
template <class Map>
point_state compare_point(map_copy<Map>& copy, std::size_t p) {
  using user = map_traits<Map>;
  const auto& points = copy.points;
  const auto& name = points.names[p];
  if (!user::alive(copy.map(), name)) return point_state::stale;
  if (!detail::is_as_before(position_of(copy.map(), name), points.positions[p])) return point_state::stale;
  const typename user::keyframe reference = user::reference(copy.map(), name);
  const auto known = points.entries[p].reference;
  if (!(copy.name(known) == reference || known == copy.number(reference))) return point_state::stale;
  std::size_t views = 0, unread = 0;
  bool same = true;
  user::for_each_observation(copy.map(), name, [&](const typename user::keyframe& observer, std::size_t keypoint) {
    ++views;
    bool found = false;
    for (const observation& o : points.lists.of(p))
      found = found || (static_cast<std::size_t>(o.keypoint) == keypoint &&
                        copy.keyframes[static_cast<std::size_t>(o.keyframe)].name == observer);
    if (found) return;
    if (copy.is_unread(observer))
      ++unread;
    else
      same = false;
  });
  if (!same || views - unread != points.lists.of(p).size()) return point_state::stale;
  return unread == 0 ? point_state::current : point_state::awaits_keyframe;
}

/// Goes round a mirror, one keyframe and a share of all points at a time.
template <class Map>
class mirror_sample {
 public:
  /// The caller holds the guard. \return how many were out of date without a report
  std::size_t check(map_copy<Map>& copy, double share) {
    if (!(share > 0)) return 0;
    const std::size_t points = check_points(copy, share);
    return points + check_keyframe(copy);  // afterwards: what one of them reads the other finds up to date
  }
  /// Begins at the first ones.
  void reset() { point_ = keyframe_ = 0; }

 private:
  std::size_t check_points(map_copy<Map>& copy, double share) {
    auto& points = copy.points;
    const double all = static_cast<double>(points.size()), wanted = share * all;
    constexpr std::size_t ahead = detail::ahead_near;
    std::size_t stale = 0, left = wanted < all ? static_cast<std::size_t>(wanted) + 1 : points.size();
    for (; left > 0 && points.size() > 1; --left) {
      point_ = point_ + 1 < points.size() ? point_ + 1 : 1;
      if (point_ + ahead < points.size()) prefetch_named(points.names[point_ + ahead]);
      if (!points.alive(static_cast<std::int32_t>(point_))) continue;
      if (points.entries[point_].read == 0) {  // nobody may ever ask for it again
        if (!map_traits<Map>::alive(copy.map(), points.names[point_])) copy.read_point(point_);
        continue;
      }
      const point_state state = compare_point(copy, point_);
      if (state == point_state::current) continue;
      stale += state == point_state::stale ? 1 : 0;
      copy.read_point(point_);
    }
    return stale;
  }
  std::size_t check_keyframe(map_copy<Map>& copy) {
    auto& keyframes = copy.keyframes;
    std::size_t left = keyframes.size() - 1;  // places of keyframes that others erased may be most of them
    do {
      if (left-- == 0) return 0;
      keyframe_ = keyframe_ + 1 < keyframes.size() ? keyframe_ + 1 : 1;
    } while (!keyframes.alive(static_cast<std::int32_t>(keyframe_)));
    if (keyframes[keyframe_].read != 0)
      return copy.read_keyframe(keyframe_, map_copy<Map>::due_slots::do_not_count) ? 1 : 0;
    if (!map_traits<Map>::alive(copy.map(), keyframes[keyframe_].name)) copy.lose_keyframe(keyframe_);
    return 0;
  }

  std::size_t point_ = 0, keyframe_ = 0;  ///< places that were looked at last
};

TURBOMAP_END_NAMESPACE
