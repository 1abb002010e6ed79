// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a commit reads again where its stage works on a map_mirror: look_again.hpp says when, here is how. Only what the commit
/// decides by is read, since reads of the user's map are slow.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/read_ahead.hpp"
#include "../prefetch.hpp"
#include "map_copy.hpp"
#include "mirror_sample.hpp"
#include "prefetch_named.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One slot of a keyframe that has just been found alive. Where the user's map gives keypoints by reference, memory is asked for
/// the keypoint: who adds or takes away the view counts it by that, and would wait.
template <class Map>
void look_at_live_slot(map_copy<Map>& copy, map_keyframe_id k, std::size_t i) {
  copy.ensure(k);
  if (i >= copy.keyframes[copy.at(k)].slots.size()) return;
  prefetch_keypoint(copy.map(), copy.name(k), i);
  copy.read_slot(copy.at(k), i, copy.name(k));
}
/// Whether a keyframe is alive, and one of its slots.
template <class Map>
void look_at_slot(map_copy<Map>& copy, map_keyframe_id k, std::size_t i) {
  if (!copy.keyframes.known(k) || !copy.keyframes.alive(k.index)) return;
  if (map_traits<Map>::alive(copy.map(), copy.name(k)))
    look_at_live_slot(copy, k, i);
  else
    copy.lose_keyframe(copy.at(k));
}
/// Whether a keyframe is alive, and its pose.
template <class Map>
void look_at_keyframe(map_copy<Map>& copy, map_keyframe_id k) {
  if (!copy.keyframes.known(k) || !copy.keyframes.alive(k.index)) return;
  const auto name = copy.name(k);
  if (!map_traits<Map>::alive(copy.map(), name)) return copy.lose_keyframe(copy.at(k));
  copy.read_pose(copy.at(k), name);
}
/// The slots that the list of a point names, which has just been read.
/// \param alive  by place, keyframes that were found alive under the guard which the caller still holds; grows
template <class Map>
void look_at_slots_of(map_copy<Map>& copy, map_point_id p, plain_vector<map_keyframe_id>& alive) {
  if (!copy.points.known(p) || !copy.points.alive(p.index)) return;
  auto& lists = copy.points.lists;
  const std::size_t place = copy.at(p);
  for (std::size_t n = 0; n < lists.of(place).size(); ++n) {
    const observation o = lists.of(place)[n];
    const map_keyframe_id k = copy.keyframes.at(o.keyframe);
    const std::size_t at = copy.at(k), i = static_cast<std::size_t>(o.keypoint);
    if (alive.size() <= at) alive.resize(copy.keyframes.size());
    if (!(alive[at] == k) || copy.keyframes[at].read == 0) {
      look_at_slot(copy, k, i);
      if (copy.keyframes.alive(k.index)) alive[at] = k;
    } else {
      look_at_live_slot(copy, k, i);
    }
  }
  copy.ensure(p);
}
/// What decides about a point in a commit: whether it is alive, its reference and its observations.
template <class Map>
void look_at_list(map_copy<Map>& copy, map_point_id p) {
  using user = map_traits<Map>;
  auto& points = copy.points;
  if (!points.known(p) || !points.alive(p.index)) return;
  const std::size_t place = copy.at(p);
  if (points.entries[place].read == 0 || !user::alive(copy.map(), copy.name(p))) return copy.read_point(place);
  const auto name = copy.name(p);
  points.entries[place].reference = copy.number(user::reference(copy.map(), name), points.entries[place].reference);
  copy.read_list(place, name);
}
/// What decides about a point that is to be erased, and has just been found alive: its observations, and their slots.
/// \param alive  as look_at_slots_of()
template <class Map>
void look_before_erasing(map_copy<Map>& copy, map_point_id p, plain_vector<map_keyframe_id>& alive) {
  auto& points = copy.points;
  if (!points.known(p) || !points.alive(p.index)) return;
  const std::size_t place = copy.at(p);
  copy.ensure(p);
  if (!points.alive(p.index)) return;
  copy.read_list(place, copy.name(p));
  look_at_slots_of(copy, p, alive);
}
/// Asks memory for what tells whether a point is alive, and its name.
template <class Map>
void ask_for_state(map_copy<Map>& copy, map_point_id p) {
  const std::size_t place = copy.at(p);
  if (place >= copy.points.size()) return;  // none
  copy.points.prefetch(p.index);
  prefetch_line(&copy.points.entries[place]), prefetch_line(&copy.points.names[place]);
}
/// Asks memory for the object behind the name of a point.
template <class Map>
void ask_for(map_copy<Map>& copy, map_point_id p) {
  const std::size_t place = copy.at(p);
  if (place >= copy.points.size()) return;  // none
  prefetch_named(copy.points.names[place]);
}
/// The same of a slot of a keyframe, and of its keypoint: what the mirror has of them.
template <class Map>
void ask_for(map_copy<Map>& copy, map_keyframe_id k, std::size_t i) {
  if (!copy.keyframes.known(k)) return;
  const auto& kept = copy.keyframes[copy.at(k)];
  if (i < kept.slots.size()) prefetch_line(&kept.slots[i]), prefetch_line(&kept.keypoints[i]);
}
/// The same of all slots that hold a point.
template <class Map>
void ask_for_slots(map_copy<Map>& copy, map_point_id p) {
  if (!copy.points.known(p)) return;
  for (const observation& o : copy.points.lists.of(copy.at(p))) {
    const auto& slots = copy.keyframes[static_cast<std::size_t>(o.keyframe)].slots;
    if (static_cast<std::size_t>(o.keypoint) < slots.size())
      prefetch_line(&slots[static_cast<std::size_t>(o.keypoint)]);
  }
}
/// Whether a point is alive.
template <class Map>
void look_whether_alive(map_copy<Map>& copy, map_point_id p) {
  if (!copy.points.known(p) || !copy.points.alive(p.index)) return;
  if (!map_traits<Map>::alive(copy.map(), copy.name(p))) copy.read_point(copy.at(p));
}
/// Whether a point is alive, and its position.
template <class Map>
void look_at_position(map_copy<Map>& copy, map_point_id p) {
  if (!copy.points.known(p) || !copy.points.alive(p.index)) return;
  const auto& name =
      copy.name(p);  // not a copy, whose count lies elsewhere: nothing moves the names before the last use
  if (!map_traits<Map>::alive(copy.map(), name))
    copy.read_point(copy.at(p));
  else
    copy.read_position(copy.at(p), name);
}

/// As has_more_measurements(), of all keyframes but one.
template <class Map>
bool has_more_measurements_without(map_copy<Map>& copy, std::size_t p, std::int32_t k, int fewest) {
  const auto is_more = [&](const auto& measurements) {
    int count = 0;
    for (const observation& o : copy.points.lists.of(p)) {
      if (o.keyframe == k || o.keyframe == copy.gone) continue;
      const auto& all = copy.keypoints(static_cast<std::size_t>(o.keyframe));
      const auto i = static_cast<std::size_t>(o.keypoint);
      if (i < all.size()) count += measurements(all, i);
      if (count > fewest) return true;
    }
    return false;
  };
  return is_more([](const auto&, std::size_t) { return 1; }) ||  // each view is one at least
         is_more([](const auto& all, std::size_t i) { return all[i].u_right >= 0 ? 2 : 1; });
}
/// Points in the slots [begin, end) of a keyframe that is to be erased; all its slots were just read. Points that keep more than
/// `fewest` measurements without it, and their reference, only lose a view: that their slot holds them is enough. The others are
/// read anew. \return whether anything had changed
template <class Map>
bool look_at_points(map_copy<Map>& copy, map_keyframe_id k, int fewest, std::size_t begin, std::size_t end) {
  using user = map_traits<Map>;
  bool differs = false;
  constexpr std::size_t ahead = ahead_far;
  for (std::size_t i = begin; i < end && i < copy.keyframes[copy.at(k)].slots.size(); ++i) {
    const auto& slots = copy.keyframes[copy.at(k)].slots;
    if (i + ahead < slots.size() && !(slots[i + ahead] == map_point_id{})) ask_for(copy, slots[i + ahead]);
    const map_point_id p = slots[i];
    if (!copy.points.known(p) || !copy.points.alive(p.index)) continue;
    const auto name = copy.name(p);
    const bool read = copy.points.entries[copy.at(p)].read != 0;
    if (read && user::alive(copy.map(), name)) {
      const auto reference = user::reference(copy.map(), name);
      if (!(reference == copy.name(k)) && has_more_measurements_without(copy, copy.at(p), k.index, fewest)) {
        // The list may be of another time: where the keyframe was the reference by then, its heir would be chosen from it.
        auto& known = copy.points.entries[copy.at(p)].reference;
        known = copy.number(reference, known);
        continue;
      }
    }
    if (read && compare_point(copy, copy.at(p)) == point_state::current) continue;
    differs = true;
    copy.read_point(copy.at(p));
  }
  return differs;
}
/// All of a keyframe that is to be erased: its slots, then their points. \return whether anything had changed
template <class Map>
bool look_at_all(map_copy<Map>& copy, map_keyframe_id k, int fewest) {
  if (!copy.keyframes.known(k)) return false;
  const bool differs = copy.read_keyframe(copy.at(k));
  return look_at_points(copy, k, fewest, 0, copy.keyframes[copy.at(k)].slots.size()) || differs;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
