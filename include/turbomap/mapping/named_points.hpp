// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Points that the user has named without the map's guard, kept until it is held. Stages on a mirror call points by numbers, and a
/// point gets its number from the map. Where the map is not mirrored, the names are the user's own.

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "working_map.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A list of points, in the order in which they were named.
template <class Map>
class named_points {
 public:
  using user_point = typename map_traits<Map>::point;                         ///< what the user calls a point
  using point = typename map_traits<typename working_map<Map>::type>::point;  ///< what stages call it

  /// Without the guard. Names of no point are passed over.
  void add(span<const user_point> points) {
    for (const user_point& p : points)
      if (!(p == user_point{})) names_.push_back(p);
  }
  /// Whether there is none.
  bool empty() const { return names_.empty(); }
  /// None.
  void clear() { names_.clear(), points_.clear(); }
  /// As stages call them; there are none afterwards. The caller holds the guard.
  span<const point> take(const working_map<Map>& map) {
    points_.clear();
    for (const user_point& p : names_) points_.push_back(map.number(p));
    names_.clear();
    return points_;
  }

 private:
  list_of<user_point> names_;
  list_of<point> points_;  ///< taken last
};

TURBOMAP_END_NAMESPACE
