// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A commit looks at the user's map again before it changes it. On the map itself there is nothing to do: every read looks. Where
/// a stage works on a map_mirror, the part that the commit concerns is read anew here, so that all its tests are made on what
/// the user's map holds by now. The caller holds the guard.

#include <cstddef>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether a map is a copy of the user's, in which a commit has to look again.
template <class Map>
inline constexpr bool is_copy_v = detail::map_has_v<Map, detail::map_look_member>;

/// Whether a keyframe is alive, and its pose.
template <class Map>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, keyframe);
}
/// What decides about a point in a commit: whether it is alive, its reference and its observations.
template <class Map>
void look_at_list([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_list(map, point);
}
/// The slots that its observations name, for a commit that writes to them.
/// \param alive  remembers which keyframes were found alive; empty when the guard is taken
template <class Map, class List>
void look_at_slots_of([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point,
                      [[maybe_unused]] List& alive) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_slots_of(map, point, alive);
}
/// Both.
template <class Map, class List>
void look_at_point(const Map& map, const typename map_traits<Map>::point& point, List& alive) {
  look_at_list(map, point);
  look_at_slots_of(map, point, alive);
}
/// One slot of a keyframe.
template <class Map>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, keyframe, keypoint);
}
/// The same of a keyframe that has been looked at since the guard was taken, and is alive.
template <class Map>
void look_at_live_slot([[maybe_unused]] const Map& map,
                       [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                       [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_live_slot(map, keyframe, keypoint);
}
/// All of it, when it is next asked for: somebody has moved the map, and what was copied before would be of another time.
template <class Map>
void forget_copy([[maybe_unused]] const Map& map) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::forget_copy(map);
}
/// The same, if it was reported that everything may have changed: for whoever takes the guard.
template <class Map>
void hear_refresh([[maybe_unused]] const Map& map) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::hear_refresh(map);
}
/// Whether a point is alive.
template <class Map>
void look_whether_alive([[maybe_unused]] const Map& map,
                        [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_whether_alive(map, point);
}
/// A point that is to be erased, and was found alive: its observations, and whether their slots agree.
/// \param alive  as look_at_point()
template <class Map, class List>
void look_before_erasing([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point,
                         [[maybe_unused]] List& alive) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_before_erasing(map, point, alive);
}
/// Asks memory for what tells whether a point is alive.
template <class Map>
void ask_for_state([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for_state(map, point);
}
/// Asks memory for what the user's map has of a point that is looked at soon. Its name should be there by then.
template <class Map>
void ask_for([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for(map, point);
}
/// The same of a slot that is looked at soon, and of its keypoint.
template <class Map>
void ask_for([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
             [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for(map, keyframe, keypoint);
}
/// The same of a keypoint alone, which there is.
template <class Map>
void ask_for_keypoint(const Map& map, const typename map_traits<Map>::keyframe& keyframe, std::size_t keypoint) {
  prefetch_keypoint(map, keyframe, keypoint);
  ask_for(map, keyframe, keypoint);
}
/// The same of all slots that hold a point. Its list should be there by then.
template <class Map>
void ask_for_slots([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for_slots(map, point);
}
/// Makes room for so many points that are added soon, and asks memory for where they will be. Throws std::bad_alloc.
template <class Map>
void expect_points([[maybe_unused]] const Map& map, [[maybe_unused]] std::size_t count) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::expect_points(map, count);
}
/// Whether a point is alive, and its position: what is quickly read.
template <class Map>
void look_at_position([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_position(map, point);
}
/// A keyframe that is to be erased: its slots, and the points that `fewest` or fewer measurements are left of.
/// \return whether anything had changed
template <class Map>
bool look_at_all([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                 [[maybe_unused]] int fewest) {
  if constexpr (is_copy_v<Map>)
    return map_traits<Map>::look_at_all(map, keyframe, fewest);
  else
    return false;
}
/// All slots of a keyframe.
template <class Map>
void look_at_slots([[maybe_unused]] const Map& map,
                   [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_slots(map, keyframe);
}
/// Points of a keyframe that is to be erased, as look_at_all(): those in the slots [begin, end), once look_at_slots() was called.
template <class Map>
void look_at_points([[maybe_unused]] const Map& map,
                    [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe, [[maybe_unused]] int fewest,
                    [[maybe_unused]] std::size_t begin, [[maybe_unused]] std::size_t end) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_points(map, keyframe, fewest, begin, end);
}

/// for_each_ahead() of points that visit() looks at again, or writes: what the user's map has of them is asked for, too.
template <unsigned What, class Map, class At, class Visit>
void for_each_named_ahead(const Map& map, std::size_t count, At at, Visit visit) {
  for_each_ahead<What>(
      map, count, at, visit, [&](const auto& point) { ask_for_state(map, point); },
      [&](const auto& point) { ask_for(map, point); });
}

/// Positions of points, read anew; those of dead points, and what is not finite, stay. \param positions  of each of them
template <class Map, class Points, class Positions>
void read_positions(const Map& map, const Points& points, Positions& positions) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    look_at_position(map, points[i]);
    if (!map_traits<Map>::alive(map, points[i]) || !has_finite_position(map, points[i])) continue;
    positions[i] = position_of(map, points[i]);
  }
}

TURBOMAP_END_NAMESPACE
