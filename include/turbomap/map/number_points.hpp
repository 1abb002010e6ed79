// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which points keyframes see, each once. Keyframes of a neighbourhood see mostly the same points. So slots are looked through
/// first, by themselves, and only what is new among them is read of the points.

#include <cstddef>

#include "../config.hpp"
#include "map_traits.hpp"
#include "numbering.hpp"
#include "read_ahead.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The points in the slots [begin, end) of a live keyframe for which keep(point) holds, in their order. The caller holds the guard.
/// O(end - begin).
/// \param list  of points, overwritten
template <class Map, class List, class Keep>
void list_points_in(const Map& map, const typename map_traits<Map>::keyframe& keyframe, std::size_t begin,
                    std::size_t end, List& list, Keep keep) {
  list.resize(end - begin);
  std::size_t kept = 0;
  for (std::size_t i = begin; i < end; ++i) {  // whether a slot is empty cannot be predicted: no branch
    const auto& p = map_traits<Map>::point_at(map, keyframe, i);
    list[kept] = p;
    kept += p == typename map_traits<Map>::point{} || !keep(p) ? 0 : 1;
  }
  list.resize(kept);
}

/// Numbers the points in the slots [begin, end) of a live keyframe: visit(point, number, whether it got the number just now). Of a
/// map that has indices dead points come too, if a slot names one: nothing was read of them. The caller holds the guard. O(end - begin).
/// \param scratch  reused memory, a list of points; visit() must not touch it
/// \throws std::bad_alloc  and what visit() throws; points before that are numbered
template <class Map, class List, class Visit>
void number_points_of(const Map& map, const typename map_traits<Map>::keyframe& keyframe, std::size_t begin,
                      std::size_t end, point_numbering<Map>& numbers, List& scratch, Visit visit) {
  using point = typename map_traits<Map>::point;
  constexpr bool by_id = !point_numbering<Map>::indexed;  // which a dead point need not have
  list_points_in(map, keyframe, begin, end, scratch, [](const point&) { return true; });
  for_each_ahead<by_id ? static_cast<unsigned>(point_data::entry) : 0>(
      map, scratch.size(), [&](std::size_t i) -> const point& { return scratch[i]; },
      [&](std::size_t, const point& p) {
        if (by_id && !map_traits<Map>::alive(map, p)) return;
        const std::size_t known = numbers.size(), number = numbers.place(map, p);
        visit(p, number, number == known);
      },
      [&](const point& p) { numbers.prefetch(map, p); });
}

TURBOMAP_END_NAMESPACE
