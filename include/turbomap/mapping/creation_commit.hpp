// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From accepted points to points of the user's map, each of their keypoints looked at again on the map as it is by then.

#include <cstddef>
#include <cstdint>

#include "../appearance/appearance_view.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../map/map_edit.hpp"
#include "../map/map_traits.hpp"
#include "../map/validate.hpp"
#include "../matching/creation_plan.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "look_again.hpp"

namespace turbomap {

/// Points that are to enter a map, in host memory; read during the call only.
struct new_points_view {
  span<const vec3<double>> positions;               ///< world, m
  span<const std::int32_t> offsets;                 ///< of each point's observations; one more than there are points
  span<const point_observation> observations = {};  ///< a point's reference keyframe first
};

/// Of a list that is worked on in parts: begin <= i < end, as far as the list goes.
struct part_of_list {
  std::size_t begin = 0;                           ///< the first
  std::size_t end = static_cast<std::size_t>(-1);  ///< behind the last
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Inserts new points, once their observations have been looked at. (Looks are qualified: what looks into a map_mirror has the same
/// names here.)
template <class Map>
class point_insertion {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;

  /// All must outlive this.
  point_insertion(Map& map, const new_points_view& points, const computed_appearances<typename traits::descriptor>& a,
                  span<const keyframe> keyframes)
      : map_(map), points_(points), appearances_(a), keyframes_(keyframes), alive_(keyframes.size()) {
    for (std::size_t n = 0; n < keyframes.size(); ++n) {
      if (keyframes[n] == keyframe{}) continue;
      turbomap::look_again(map, keyframes[n]);
      alive_[n] = traits::alive(map, keyframes[n]) ? 1 : 0;
    }
  }
  /// Looks at the slots of the observations [begin, end). \throws what commit_points() throws
  void look(std::size_t begin, std::size_t end, fault_sink faults) const {
    for (std::size_t v = begin; v < end; ++v) {
      if (v + ahead_near < end) {
        const point_observation& next = points_.observations[v + ahead_near];
        const auto n = static_cast<std::size_t>(next.keyframe);
        if (n < keyframes_.size()) turbomap::ask_for(map_, keyframes_[n], static_cast<std::size_t>(next.keypoint));
      }
      const point_observation& o = points_.observations[v];
      require(o.keyframe >= 0 && static_cast<std::size_t>(o.keyframe) < keyframes_.size(), "observations[].keyframe",
              o.keyframe, "is not the number of a keyframe");
      if (!is_alive(o)) continue;
      require(o.keypoint >= 0 && keypoint_of(o) < keypoint_count_of(map_, keyframe_of(o)), "observations[].keypoint",
              o.keypoint, "is not a keypoint of the keyframe");
      turbomap::look_at_live_slot(map_, keyframe_of(o), keypoint_of(o));
      require_consistent_slot(map_, keyframe_of(o), keypoint_of(o), faults);
    }
  }
  /// Inserts point i, if two of its observations are possible. See commit_points().
  template <class List>
  void insert(std::size_t i, List& created, List& due) const {
    const auto begin = static_cast<std::size_t>(points_.offsets[i]),
               end = static_cast<std::size_t>(points_.offsets[i + 1]);
    std::size_t views = 0, first = end;
    for (std::size_t v = end; v-- > begin;)
      if (is_possible(points_.observations[v])) {
        views += is_camera_among(points_.observations[v], v + 1, end) ? 0 : 1;
        first = v;
      }
    if (views < 2) return;
    const auto point = traits::add_point(map_, points_.positions[i], keyframe_of(points_.observations[first]));
    if constexpr (map_has_v<Map, map_reserve_member>) {
      try {
        traits::reserve_observations(map_, point, views);
      } catch (...) {  // without a view it is no point
        traits::retire(map_, point, typename traits::point{});
        throw;
      }
    }
    describe(i, point);
    observe_possible(first, end, point);
    created.push_back(point);
    if constexpr (map_has_v<Map, map_created_member>) traits::created(map_, point);
    if (views < end - begin) due.push_back(point);
  }

 private:
  const keyframe& keyframe_of(const point_observation& o) const {
    return keyframes_[static_cast<std::size_t>(o.keyframe)];
  }
  static std::size_t keypoint_of(const point_observation& o) { return static_cast<std::size_t>(o.keypoint); }
  bool is_alive(const point_observation& o) const { return alive_[static_cast<std::size_t>(o.keyframe)] != 0; }
  bool is_possible(const point_observation& o) const {
    return is_alive(o) && traits::point_at(map_, keyframe_of(o), keypoint_of(o)) == typename traits::point{};
  }
  /// Whether one of the observations [begin, end) that are possible is by the same camera.
  bool is_camera_among(const point_observation& o, std::size_t begin, std::size_t end) const {
    for (std::size_t v = begin; v < end; ++v) {
      const point_observation& other = points_.observations[v];
      if (keyframe_of(other) == keyframe_of(o) && is_possible(other) &&
          turbomap::keypoint_of(map_, keyframe_of(o), keypoint_of(other)).camera ==
              turbomap::keypoint_of(map_, keyframe_of(o), keypoint_of(o)).camera)
        return true;
    }
    return false;
  }
  void describe(std::size_t i, const typename traits::point& point) const {
    if (appearances_.empty()) return;
    const point_appearance& a = appearances_.points[i];
    traits::set_appearance(map_, point, a.normal, a.min_distance, a.max_distance, appearances_.descriptor(i));
    if constexpr (map_has_v<Map, map_covariance_member>) traits::set_covariance(map_, point, a.covariance);
  }
  /// Those of the observations [first, end) that are possible.
  void observe_possible(std::size_t first, std::size_t end, const typename traits::point& point) const {
    for (std::size_t v = first; v < end; ++v) {
      const point_observation& o = points_.observations[v];
      if (!is_possible(o)) continue;
      bool seen_yet = false;  // by names, not numbers: nobody promises that a keyframe has only one
      for (std::size_t u = first; u < v; ++u)
        seen_yet = seen_yet || keyframe_of(points_.observations[u]) == keyframe_of(o);
      if (seen_yet)  // perhaps by the same camera
        observe(map_, point, keyframe_of(o), keypoint_of(o));
      else
        observe_first(map_, point, keyframe_of(o), keypoint_of(o));
    }
  }

  Map& map_;
  const new_points_view& points_;
  const computed_appearances<typename traits::descriptor>& appearances_;
  span<const keyframe> keyframes_;
  plain_vector<std::uint8_t> alive_;  ///< of each keyframe
};

}  // namespace detail

/// Inserts points in their order, each with those of its observations that are still possible, if these are two at least. A
/// keypoint that has a point by then, given by an earlier entry or by somebody else since the search, gets no second one, and
/// neither does one of a keyframe that is gone; a camera sees a point by one keypoint, the first that is named. The caller holds
/// the guard of the map.
/// \param appearances  of each point: it enters the map with it, so that nobody reads a point without descriptor and range.
///                     Empty: the appearance of the new points is due
/// \param keyframes    those that observations name by number
/// \param created      the new points, appended
/// \param due          those that entered with fewer observations than they were described with, appended: their
///                     appearance is due
/// \throws std::invalid_argument  an index out of range, appearances that are not as many as the points; inconsistent_map
///         where a slot contradicts the map. Everything is checked before the first point of the part is inserted. And what
///         add_point() and reserve_observations() of the traits throw: the points before are complete then
/// \param faults       where to note slots that contradict the map instead; their keypoints get no point
/// \param part         the points to insert: several calls in their order do what one does with all
/// O(points + keyframes + observations of the part).
template <class Map, class List>
void commit_points(Map& map, const new_points_view& points,
                   const computed_appearances<typename map_traits<Map>::descriptor>& appearances,
                   span<const typename map_traits<Map>::keyframe> keyframes, List& created, List& due,
                   fault_sink faults = {}, part_of_list part = {}) {
  static_assert(require_map_traits<Map>());
  const std::size_t count = points.positions.size();
  const std::size_t part_end = part.end < count ? part.end : count;
  if (part.begin > part_end) part.begin = part_end;
  require(points.offsets.size() == count + 1, "offsets.size()", points.offsets.size(),
          "must be that of the points, plus 1");
  require(appearances.empty() || appearances.size() == count, "appearances.size()", appearances.size(),
          "must be that of the points, or 0");
  std::int32_t before = 0;
  for (const std::int32_t at : points.offsets) {
    require(at >= before && static_cast<std::size_t>(at) <= points.observations.size(), "offsets[]", at,
            "must not fall, and be at most the number of observations");
    before = at;
  }
  const detail::point_insertion<Map> insertion(map, points, appearances, keyframes);
  // What no point has takes part in the first part and the last.
  const auto offset = [&](std::size_t i) { return static_cast<std::size_t>(points.offsets[i]); };
  insertion.look(part.begin == 0 ? 0 : offset(part.begin),
                 part_end == count ? points.observations.size() : offset(part_end), faults);
  make_room(created, created.size() + part_end - part.begin), make_room(due, due.size() + part_end - part.begin);
  expect_points(map, part_end - part.begin);
  for (std::size_t i = part.begin; i < part_end; ++i) insertion.insert(i, created, due);
}

/// The same for the accepted points of pairs, in the order of their plan, (neighbour, query keypoint): a point enters the map if
/// both of its keypoints are free.
/// \param appearances  of each entry of the plan, or none
template <class Map, class List>
void commit_points(Map& map, span<const created_point> plan,
                   const computed_appearances<typename map_traits<Map>::descriptor>& appearances,
                   typename map_traits<Map>::keyframe query, span<const typename map_traits<Map>::keyframe> neighbours,
                   List& created) {
  plain_vector<vec3<double>> positions;
  plain_vector<std::int32_t> offsets(1);
  plain_vector<point_observation> observations;
  list_of<typename map_traits<Map>::keyframe> keyframes;
  keyframes.push_back(query);
  List due;
  for (const auto n : neighbours) keyframes.push_back(n);
  for (const created_point& p : plan) {
    require(p.neighbour >= 0 && static_cast<std::size_t>(p.neighbour) < neighbours.size(), "plan[].neighbour",
            p.neighbour, "is not the number of a neighbour");
    if (p.outcome == creation_outcome::accepted) {
      observations.push_back({0, p.query});
      observations.push_back({1 + p.neighbour, p.candidate});
    }
    positions.push_back(p.position);
    offsets.push_back(static_cast<std::int32_t>(observations.size()));
  }
  commit_points<Map, List>(map, new_points_view{positions, offsets, observations}, appearances, keyframes, created,
                           due);
}

TURBOMAP_END_NAMESPACE
