// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Every change that the library makes to a user's map: observe, forget, move, merge, erase. Each writes both sides (the
/// slot of the keyframe, the list of the point) and keeps the counts, so that these hold before and after:
/// - a slot holds a live point that lists this keypoint, or nothing; an observation is of a live keyframe whose slot agrees;
/// - no point is observed twice by one camera of a keyframe;
/// - counts by octave equal recount().
/// The caller holds the map's guard. Points and keyframes are alive unless a comment says otherwise.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "map_traits.hpp"
#include "merge_rule.hpp"
#include "observation_counts.hpp"
#include "points_apart.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class Map>
void change_count([[maybe_unused]] Map& map, [[maybe_unused]] typename map_traits<Map>::point point,
                  [[maybe_unused]] int octave, [[maybe_unused]] int change) {
  if constexpr (counts_octaves_v<Map>) map_traits<Map>::change_octave_count(map, point, octave, change);
}

/// The keyframe's contribution to the counts goes from octave `before` to `after`; -1: none.
template <class Map>
void move_count(Map& map, typename map_traits<Map>::point point, int before, int after) {
  if (before == after) return;
  if (before >= 0) change_count(map, point, before, -1);
  if (after >= 0) change_count(map, point, after, +1);
}

inline int finer(int a, int b) { return a < 0 ? b : b < 0 ? a : a < b ? a : b; }

/// The keyframe sees the point no longer: if it was its reference, the observer of lowest id is from now on.
template <class Map>
void lose_reference(Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::keyframe keyframe) {
  using traits = map_traits<Map>;
  if (!(traits::reference(map, point) == keyframe)) return;
  typename traits::keyframe first{};
  bool found = false;
  traits::for_each_observation(map, point, [&](typename traits::keyframe observer, std::size_t) {
    if (!found || traits::id(map, observer) < traits::id(map, first)) first = observer;
    found = true;
  });
  if (found) traits::set_reference(map, point, first);
}

/// What a point's views are to one of them.
struct view_counts {
  int own = 0;          ///< of the same keyframe, itself too
  int others = 0;       ///< of other keyframes
  bool listed = false;  ///< whether it is among them
};
/// O(views).
template <class Map>
view_counts count_views(const Map& map, typename map_traits<Map>::point point,
                        typename map_traits<Map>::keyframe keyframe, std::size_t keypoint) {
  view_counts views;
  map_traits<Map>::for_each_observation(map, point, [&](typename map_traits<Map>::keyframe k, std::size_t i) {
    const bool own = k == keyframe;
    views.own += own ? 1 : 0, views.others += own ? 0 : 1;
    views.listed = views.listed || (own && i == keypoint);
  });
  return views;
}

}  // namespace detail

/// The live point that a point has become: itself, or what it was merged into, merged again and again; point{} for none. A
/// chain that runs in a circle, which no edit makes, ends too.
template <class Map>
typename map_traits<Map>::point resolve(const Map& map, typename map_traits<Map>::point point) {
  using traits = map_traits<Map>;
  const typename traits::point none{};
  auto slow = point;
  for (bool advance = false; !(point == none) && !traits::alive(map, point); advance = !advance) {
    point = traits::replacement(map, point);
    if (advance) slow = traits::replacement(map, slow);
    if (point == slow) return traits::alive(map, point) ? point : none;
  }
  return point;
}

/// Keypoint `keypoint` of `keyframe` sees `point`. False, and nothing is changed, where the slot holds a point already or
/// the same camera sees the point already. O(views).
template <class Map>
bool observe(Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::keyframe keyframe,
             std::size_t keypoint) {
  using traits = map_traits<Map>;
  if (!(traits::point_at(map, keyframe, keypoint) == typename traits::point{})) return false;
  const auto k = keypoint_of(map, keyframe, keypoint);
  if (observed_at(map, point, keyframe, k.camera) >= 0) return false;
  [[maybe_unused]] int before = -1;
  if constexpr (counts_octaves_v<Map>) before = finest_octave(map, point, keyframe);
  traits::add_observation(map, point, keyframe, keypoint);
  traits::set_point(map, keyframe, keypoint, point);
  if constexpr (counts_octaves_v<Map>) detail::move_count(map, point, before, detail::finer(before, k.octave));
  return true;
}

/// The same where it is known that the slot is empty and that the keyframe does not see the point: nothing is read for it.
template <class Map>
void observe_first(Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::keyframe keyframe,
                   std::size_t keypoint) {
  using traits = map_traits<Map>;
  traits::add_observation(map, point, keyframe, keypoint);
  traits::set_point(map, keyframe, keypoint, point);
  if constexpr (counts_octaves_v<Map>)
    detail::change_count(map, point, keypoint_of(map, keyframe, keypoint).octave, +1);
}

/// Removes an observation: the keypoint no longer sees its point. The point stays, even without observations (see fade()).
/// If it loses its last view in its reference keyframe, the observer of lowest id becomes its reference. Returns the
/// point, point{} for an empty slot.
template <class Map>
typename map_traits<Map>::point forget(Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t keypoint) {
  using traits = map_traits<Map>;
  const typename traits::point none{}, point = traits::point_at(map, keyframe, keypoint);
  if (point == none) return none;
  [[maybe_unused]] int before = -1;
  if constexpr (counts_octaves_v<Map>) before = finest_octave(map, point, keyframe);
  traits::erase_observation(map, point, keyframe, keypoint);
  traits::set_point(map, keyframe, keypoint, none);
  const int after = finest_octave(map, point, keyframe);
  if constexpr (counts_octaves_v<Map>) detail::move_count(map, point, before, after);
  if (after < 0) detail::lose_reference(map, point, keyframe);
  return point;
}

/// Takes a point out of the map, merged or not: all its slots are emptied first. With a replacement nothing is announced here:
/// merge_points() calls `merged` of the traits when its observations have moved. Without one `erased` is called. O(views), and
/// O(views^2) where octaves are counted.
template <class Map>
void erase_point(Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::point replacement = {}) {
  using traits = map_traits<Map>;
  struct view {
    typename traits::keyframe observer{};
    std::size_t keypoint = 0;
  };
  constexpr std::size_t most = 16;
  for (;;) {  // so many at a time: the list changes while it is emptied
    view views[most];
    std::size_t count = 0;
    traits::for_each_observation(map, point, [&](typename traits::keyframe k, std::size_t i) {
      if (count < most) views[count++] = {k, i};
    });
    for (std::size_t v = 0; v < count; ++v) {
      const auto& [observer, at] = views[v];
      [[maybe_unused]] int before = -1;
      if constexpr (detail::users_counts_v<Map>) before = finest_octave(map, point, observer);
      traits::erase_observation(map, point, observer, at);
      traits::set_point(map, observer, at, typename traits::point{});
      if constexpr (detail::users_counts_v<Map>)
        detail::move_count(map, point, before, finest_octave(map, point, observer));
    }
    if (count < most) break;
  }
  traits::retire(map, point, replacement);
  if constexpr (detail::map_has_v<Map, detail::map_erased_member>)
    if (replacement == typename traits::point{}) traits::erased(map, point);
}

namespace detail {
/// fade() of the point in a slot, whose views are counted: most often the keyframe sees it once, and nothing else is read of them.
template <class Map>
bool fade(Map& map, typename map_traits<Map>::point point, typename map_traits<Map>::keyframe keyframe,
          std::size_t keypoint, const view_counts& views, int fewest) {
  using traits = map_traits<Map>;
  if (views.own == 1 && views.listed) {
    [[maybe_unused]] int octave = -1;
    if constexpr (counts_octaves_v<Map>) octave = keypoint_of(map, keyframe, keypoint).octave;
    traits::erase_observation(map, point, keyframe, keypoint);
    traits::set_point(map, keyframe, keypoint, typename traits::point{});
    move_count(map, point, octave, -1);
    lose_reference(map, point, keyframe);
    if (views.others > fewest || measurement_count(map, point) > fewest) return false;
  } else {
    forget(map, keyframe, keypoint);
    if (has_more_measurements(map, point, fewest)) return false;
  }
  erase_point(map, point);
  return true;
}
}  // namespace detail

/// forget(), then erases the point when it has `fewest` measurements or less (2, as [ORB-SLAM3]). True if it was erased.
template <class Map>
bool fade(Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t keypoint, int fewest = 2) {
  const auto point = map_traits<Map>::point_at(map, keyframe, keypoint);
  if (point == typename map_traits<Map>::point{}) return false;
  return detail::fade(map, point, keyframe, keypoint, detail::count_views(map, point, keyframe, keypoint), fewest);
}

/// The observation goes from one keypoint of a keyframe to another. False, and nothing is changed, where there is none, the
/// target slot is taken, or the camera of the target sees the point by a third keypoint.
template <class Map>
bool move_observation(Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t from, std::size_t to) {
  using traits = map_traits<Map>;
  const typename traits::point none{}, point = traits::point_at(map, keyframe, from);
  if (point == none || !(traits::point_at(map, keyframe, to) == none)) return false;
  const auto other = observed_at(map, point, keyframe, keypoint_of(map, keyframe, to).camera);
  if (other >= 0 && static_cast<std::size_t>(other) != from) return false;
  const int before = finest_octave(map, point, keyframe);
  traits::erase_observation(map, point, keyframe, from);
  traits::set_point(map, keyframe, from, none);
  traits::add_observation(map, point, keyframe, to);
  traits::set_point(map, keyframe, to, point);
  detail::move_count(map, point, before, finest_octave(map, point, keyframe));
  return true;
}

/// `from` becomes `into`: its observations move over, it is retired with `into` as its replacement. False, and nothing is
/// changed, when the rule refuses; under merge_rule::refuse no observation is ever lost. `scratch` is reused memory; it grows,
/// and room for the observations is made (reserve_observations of the traits), before anything is changed.
template <class Map, class Views>
bool merge_points(Map& map, typename map_traits<Map>::point from, typename map_traits<Map>::point into, merge_rule rule,
                  Views& scratch, const merge_tolerance& tolerance = {}) {
  using traits = map_traits<Map>;
  if (from == into || (rule == merge_rule::refuse && seen_apart(map, from, into)) ||
      (rule == merge_rule::refuse_apart &&
       (seen_apart(map, from, into, tolerance) || known_apart(map, from, into, tolerance))))
    return false;
  scratch.clear();
  traits::for_each_observation(map, from, [&](typename traits::keyframe observer, std::size_t keypoint) {
    scratch.push_back({observer, keypoint});
  });
  if constexpr (detail::map_has_v<Map, detail::map_reserve_member>)
    traits::reserve_observations(map, into, scratch.size());
  erase_point(map, from, into);
  for (const auto& [observer, keypoint] : scratch) observe(map, into, observer, keypoint);
  if constexpr (detail::map_has_v<Map, detail::map_merged_member>) traits::merged(map, from, into);
  return true;
}

/// fade() of the keypoints [begin, end) of a keyframe that see a point: a part of erase_keyframe(), for who lets others have the map
/// in between. It then is sound, and the keyframe sees fewer points. Points that live on and lost a view are appended to `touched`
/// (null, or a pointer to a list): of all keypoints together once, of a part with each view, as the other parts may never follow.
template <class Map, class Touched = std::nullptr_t>
void fade_keypoints(Map& map, typename map_traits<Map>::keyframe keyframe, std::size_t begin, std::size_t end,
                    int fewest = 2, [[maybe_unused]] Touched touched = nullptr) {
  using traits = map_traits<Map>;
  [[maybe_unused]] const bool all = begin == 0 && end == keypoint_count_of(map, keyframe);
  for (std::size_t i = begin; i < end; ++i) {
    const auto point = traits::point_at(map, keyframe, i);
    if (point == typename traits::point{}) continue;
    const detail::view_counts views = detail::count_views(map, point, keyframe, i);
    if constexpr (!std::is_null_pointer_v<Touched>)
      if (touched != nullptr) touched->push_back(point);  // first: what throws below loses none
    const bool gone = detail::fade(map, point, keyframe, i, views, fewest);
    [[maybe_unused]] const bool seen_yet = views.own > (views.listed ? 1 : 0);  // by another camera of the rig
    if constexpr (!std::is_null_pointer_v<Touched>)
      if (touched != nullptr && (gone || (all && seen_yet))) touched->pop_back();
  }
}

/// Takes a keyframe out of the map: all its observations are removed, and points with `fewest` measurements or less are
/// erased; each is announced while the keyframe is still alive, with its other points. The points that live on and lost a view are
/// appended to `touched`: null, or a pointer to a list.
template <class Map, class Touched = std::nullptr_t>
void erase_keyframe(Map& map, typename map_traits<Map>::keyframe keyframe, int fewest = 2, Touched touched = nullptr) {
  fade_keypoints(map, keyframe, 0, keypoint_count_of(map, keyframe), fewest, touched);
  map_traits<Map>::erase_keyframe(map, keyframe);
}

TURBOMAP_END_NAMESPACE
