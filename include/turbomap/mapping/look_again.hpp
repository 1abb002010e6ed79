// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A commit looks at the user's map again before it changes it. On the map itself there is nothing to do: every read looks. Where
/// a stage works on a map_mirror, the part that the commit concerns is read anew here, so that all its tests are made on what
/// the user's map holds by now. The caller holds the guard.

#include <cstddef>
#include <type_traits>

#include "../config.hpp"
#include "../map/map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether a map is a copy of the user's, in which a commit has to look again.
template <class Map>
inline constexpr bool is_copy_v = detail::map_has_v<Map, detail::map_look_member>;

/// A point (all of it), or a keyframe (whether it is alive, and its pose).
template <class Map, class Name>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const Name& name) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, name);
}
/// One slot of a keyframe.
template <class Map>
void look_again([[maybe_unused]] const Map& map, [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                [[maybe_unused]] std::size_t keypoint) {
  if constexpr (is_copy_v<Map>) map_traits<Map>::look_again(map, keyframe, keypoint);
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

TURBOMAP_END_NAMESPACE
