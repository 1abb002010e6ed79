// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads points of a map one after the other. What a map keeps of a point lies in several arrays, at a place that the processor
/// cannot predict, so most of the time of such a loop is waiting for memory. Maps whose traits can prefetch() are asked for the
/// next points while one is worked on. The points, and their order, are the same.

#include <cstddef>
#include <type_traits>

#include "../config.hpp"
#include "../prefetch.hpp"
#include "map_traits.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
/// Points from the one that is worked on to the one whose arrays are asked for, and to the one whose list of observations is:
/// where that lies is known by then. Measured, a few more or less make no difference.
constexpr std::size_t ahead_far = 16, ahead_near = 8;
struct nothing_else {
  template <class Point>
  void operator()(const Point&) const {}
};
}  // namespace detail

/// Calls visit(i, at(i)) for 0 <= i < count. \tparam What  what visit() reads of a point, a sum of point_data
/// \param at    at(i): the i-th point, or none, or one that is gone. Asked several times, so it must be cheap
/// \param also  also(point): asks for what else visit() reads; not called for none
/// \param near  near(point): the same, when the point is nearer: for what lies where `also` has asked
template <unsigned What, class Map, class At, class Visit, class Also = detail::nothing_else,
          class Near = detail::nothing_else>
void for_each_ahead([[maybe_unused]] const Map& map, std::size_t count, At at, Visit visit,
                    [[maybe_unused]] Also also = {}, [[maybe_unused]] Near near = {}) {
  if constexpr (detail::map_has_v<Map, detail::map_prefetch_member>) {
    using traits = map_traits<Map>;
    constexpr auto views = static_cast<unsigned>(point_data::views);
    const typename traits::point none{};  // what traits never get
    const auto ask = [&](const auto& point) {
      if (!(point == none)) traits::prefetch(map, point, What & ~views), also(point);
    };
    const auto ask_near = [&](const auto& point) {
      if (point == none) return;
      if constexpr ((What & views) != 0) traits::prefetch(map, point, views);
      near(point);
    };
    for (std::size_t i = 0; i < detail::ahead_far && i < count; ++i) ask(at(i));
    for (std::size_t i = 0; i < count; ++i) {
      if (i + detail::ahead_far < count) ask(at(i + detail::ahead_far));
      if (i + detail::ahead_near < count) ask_near(at(i + detail::ahead_near));
      visit(i, at(i));
    }
  } else {
    for (std::size_t i = 0; i < count; ++i) visit(i, at(i));
  }
}

/// The same of the slots of a keyframe, many of which are empty.
template <unsigned What, class Map, class Visit>
void for_each_slot_ahead(const Map& map, const typename map_traits<Map>::keyframe& keyframe, Visit visit) {
  for_each_ahead<What>(
      map, keypoint_count_of(map, keyframe), [&](std::size_t i) { return map_traits<Map>::point_at(map, keyframe, i); },
      visit);
}

/// Asks memory for a keypoint, which there is, where the map gives keypoints by reference.
template <class Map>
void prefetch_keypoint([[maybe_unused]] const Map& map,
                       [[maybe_unused]] const typename map_traits<Map>::keyframe& keyframe,
                       [[maybe_unused]] std::size_t keypoint) {
  if constexpr (std::is_lvalue_reference_v<decltype(keypoint_of(map, keyframe, keypoint))>)
    prefetch_line(&keypoint_of(map, keyframe, keypoint));
}

TURBOMAP_END_NAMESPACE
