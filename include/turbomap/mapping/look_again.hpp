// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Others may have changed the user's map since a stage read it, so a commit reads again what it is about to change. On the map
/// itself these functions do nothing, because every read is fresh. On a map_mirror, look_...() reads a part of the user's map anew
/// into the mirror, and ask_for...() asks memory for what is read soon. The caller holds the guard.

#include <cstddef>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether a map is a copy of the user's, in which a commit has to look again.
template <class Map>
inline constexpr bool is_copy_v = detail::map_has_v<Map, detail::map_look_member>;

/// Reads anew whether a keyframe is alive, and its pose.
template <class Map>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, keyframe);
}
/// Reads anew what decides about a point in a commit: whether it is alive, its reference and its observations.
template <class Map>
void look_at_list([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_list(map, point);
}
/// Reads anew the slots that a point's observations name, for a commit that writes to them.
/// \param alive  remembers which keyframes were found alive; empty when the guard is taken
template <class Map, class List>
void look_at_slots_of([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point,
                      [[maybe_unused]] List& alive) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_slots_of(map, point, alive);
}
/// look_at_list() and look_at_slots_of().
template <class Map, class List>
void look_at_point(const Map& map, const typename map_traits<Map>::point& point, List& alive) {
  look_at_list(map, point);
  look_at_slots_of(map, point, alive);
}
/// Reads one slot of a keyframe anew.
template <class Map>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, keyframe, keypoint);
}
/// Reads one slot anew, of a keyframe that was found alive since the guard was taken: that is not asked again.
template <class Map>
void look_at_live_slot([[maybe_unused]] const Map& map,
                       [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                       [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_live_slot(map, keyframe, keypoint);
}
/// Forgets the whole copy: somebody has moved the map. Each part is read anew when it is next asked for.
template <class Map>
void forget_copy([[maybe_unused]] const Map& map) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::forget_copy(map);
}
/// As forget_copy(), if somebody has called refresh() since. Called whenever the guard is taken.
template <class Map>
void hear_refresh([[maybe_unused]] const Map& map) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::hear_refresh(map);
}
/// Reads anew whether a point is alive.
template <class Map>
void look_whether_alive([[maybe_unused]] const Map& map,
                        [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_whether_alive(map, point);
}
/// Reads anew the observations of a point that is to be erased and was found alive, and whether their slots agree.
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
/// Asks memory for a slot that is looked at soon, and for its keypoint.
template <class Map>
void ask_for([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
             [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for(map, keyframe, keypoint);
}
/// As ask_for() of a slot, and asks for its keypoint on any map, not only on a copy. The keypoint must exist.
template <class Map>
void ask_for_keypoint(const Map& map, const typename map_traits<Map>::keyframe& keyframe, std::size_t keypoint) {
  prefetch_keypoint(map, keyframe, keypoint);
  ask_for(map, keyframe, keypoint);
}
/// Asks memory for all slots that hold a point. Its list of observations should be there by then.
template <class Map>
void ask_for_slots([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::ask_for_slots(map, point);
}
/// Makes room for so many points that are added soon, and asks memory for where they will be. Throws std::bad_alloc.
template <class Map>
void expect_points([[maybe_unused]] const Map& map, [[maybe_unused]] std::size_t count) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::expect_points(map, count);
}
/// Reads anew whether a point is alive, and its position. Cheaper than look_at_list().
template <class Map>
void look_at_position([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::point& point) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_position(map, point);
}
/// Reads anew the slots of a keyframe that is to be erased, and its points that have `fewest` or fewer measurements left.
/// \return whether anything had changed
template <class Map>
bool look_at_all([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                 [[maybe_unused]] int fewest) {
  if constexpr (is_copy_v<Map>)
    return map_traits<Map>::look_at_all(map, keyframe, fewest);
  else
    return false;
}
/// Reads all slots of a keyframe anew.
template <class Map>
void look_at_slots([[maybe_unused]] const Map& map,
                   [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_at_slots(map, keyframe);
}
/// Reads anew the points in the slots [begin, end) of a keyframe that is to be erased, as look_at_all() does for all of them.
/// look_at_slots() comes before it.
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

/// Reads the positions of points anew. A position stays as it was where the point is dead or its new position is not finite.
/// \param positions  one per point
template <class Map, class Points, class Positions>
void read_positions(const Map& map, const Points& points, Positions& positions) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    look_at_position(map, points[i]);
    if (!map_traits<Map>::alive(map, points[i]) || !has_finite_position(map, points[i])) continue;
    positions[i] = position_of(map, points[i]);
  }
}

TURBOMAP_END_NAMESPACE
