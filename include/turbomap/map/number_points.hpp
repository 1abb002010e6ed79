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

/// Numbers the points in the slots [begin, end) of a live keyframe: visit(point, number, whether it got the number just now). Of a
/// map that has indices dead points come too, if a slot names one: nothing was read of them. The caller holds the guard. O(end - begin).
/// \param scratch  reused memory, a list of points; visit() must not touch it
/// \throws std::bad_alloc  and what visit() throws; points before that are numbered
template <class Map, class List, class Visit>
void number_points_of(const Map& map, const typename map_traits<Map>::keyframe& keyframe, std::size_t begin,
                      std::size_t end, point_numbering<Map>& numbers, List& scratch, Visit visit) {
  using traits = map_traits<Map>;
  using point = typename traits::point;
  constexpr bool by_id = !point_numbering<Map>::indexed;  // which a dead point need not have
  scratch.resize(end - begin);
  std::size_t named = 0;
  for (std::size_t i = begin; i < end; ++i) {  // whether a slot is empty cannot be predicted: no branch
    const auto& p = traits::point_at(map, keyframe, i);
    scratch[named] = p;
    named += p == point{} ? 0 : 1;
  }
  for_each_ahead<by_id ? static_cast<unsigned>(point_data::entry) : 0>(
      map, named, [&](std::size_t i) -> const point& { return scratch[i]; },
      [&](std::size_t, const point& p) {
        if (by_id && !traits::alive(map, p)) return;
        const std::size_t known = numbers.size(), number = numbers.place(map, p);
        visit(p, number, number == known);
      },
      [&](const point& p) { numbers.prefetch(map, p); });
}

TURBOMAP_END_NAMESPACE
