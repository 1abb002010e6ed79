// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From accepted points of a plan to points of the user's map, each tested again on the map as it is by then.

#include <cstddef>
#include <cstdint>

#include "../appearance/appearance_view.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/validate.hpp"
#include "../matching/creation_plan.hpp"
#include "../span.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Inserts the accepted points in the order of the plan, (neighbour, query keypoint). A keypoint that has a point by then,
/// given by an earlier entry or by somebody else since the search, gets no second one, and neither does one of a keyframe
/// that is gone. The caller holds the guard of the map.
/// \param appearances  of each entry of the plan: the point enters the map with it, so that nobody reads a point without
///                     descriptor and range. Empty: the appearance of the new points is due
/// \param created      the new points, appended
/// \throws std::invalid_argument  an index out of range, appearances that are not as many as the plan's entries;
///         inconsistent_map where a slot contradicts the map. All of the plan is checked before the first point is inserted
/// O(plan).
template <class Map, class List>
void commit_points(Map& map, span<const created_point> plan,
                   const computed_appearances<typename map_traits<Map>::descriptor>& appearances,
                   typename map_traits<Map>::keyframe query, span<const typename map_traits<Map>::keyframe> neighbours,
                   List& created) {
  using traits = map_traits<Map>;
  static_assert(require_map_traits<Map>());
  require(appearances.empty() || appearances.size() == plan.size(), "appearances.size()", appearances.size(),
          "must be that of the plan, or 0");
  if (!traits::alive(map, query)) return;
  const auto check = [&](typename traits::keyframe keyframe, std::int32_t keypoint, const char* argument) {
    require(keypoint >= 0 && static_cast<std::size_t>(keypoint) < keypoint_count_of(map, keyframe), argument, keypoint,
            "is not a keypoint of the keyframe");
    require_consistent_slot(map, keyframe, static_cast<std::size_t>(keypoint));
  };
  std::size_t accepted = 0;
  for (const created_point& p : plan) {
    require(p.neighbour >= 0 && static_cast<std::size_t>(p.neighbour) < neighbours.size(), "plan[].neighbour",
            p.neighbour, "is not the number of a neighbour");
    if (p.outcome != creation_outcome::accepted) continue;
    ++accepted;
    check(query, p.query, "plan[].query");
    const auto neighbour = neighbours[static_cast<std::size_t>(p.neighbour)];
    if (traits::alive(map, neighbour)) check(neighbour, p.candidate, "plan[].candidate");
  }
  created.reserve(created.size() + accepted);
  const auto is_free = [&](typename traits::keyframe keyframe, std::int32_t keypoint) {
    return traits::point_at(map, keyframe, static_cast<std::size_t>(keypoint)) == typename traits::point{};
  };
  for (std::size_t i = 0; i < plan.size(); ++i) {
    const created_point& p = plan[i];
    if (p.outcome != creation_outcome::accepted) continue;
    const auto neighbour = neighbours[static_cast<std::size_t>(p.neighbour)];
    if (!traits::alive(map, neighbour) || !is_free(query, p.query) || !is_free(neighbour, p.candidate)) continue;
    const auto point = traits::add_point(map, p.position, query);
    if (!appearances.empty()) {
      const point_appearance& a = appearances.points[i];
      traits::set_appearance(map, point, a.normal, a.min_distance, a.max_distance, appearances.descriptor(i));
    }
    observe(map, point, query, static_cast<std::size_t>(p.query));
    observe(map, point, neighbour, static_cast<std::size_t>(p.candidate));
    created.push_back(point);
  }
}

TURBOMAP_END_NAMESPACE
