// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From a user's map to the arrays of an appearance update: points with their positions and views, and the keyframes that see
/// them.

#include <cstddef>
#include <cstdint>

#include "../appearance/appearance_view.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "keyframe_selection.hpp"
#include "look_again.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Make one and use it for every call: its memory is reused.
template <class Map>
class appearance_snapshot {
 public:
  /// @{
  /// Types of the map, as its traits name them.
  using traits = map_traits<Map>;
  using point = typename traits::point;
  using keyframe = typename traits::keyframe;
  /// @}

  /// Begins anew: no point has been taken in.
  void clear() { seen_.clear(); }
  /// Takes in those of the points that have not been since clear(), in the place of those that were. Dead and unobserved ones are
  /// passed over, and so are observers that are not in the store. Parts are read under the scope's guard; if somebody has moved an
  /// observer between two of them, poses and positions are read anew, so that all are of one time.
  /// \throws inconsistent_map  as appearance_update
  template <class Policy>
  void read(const mapping_scope<Map, Policy>& s, span<const point> points) {
    std::size_t next = 0;
    s.in_parts(
        [&] {
          observers_.clear();
          points_.clear(), positions_.clear(), observations_.clear(), references_.clear();
          offsets_.assign(1, 0);
        },
        [&] {
          if (observers_.read_poses(s.map)) read_positions(s.map, points_, positions_);
        },
        [&](std::size_t most) {
          const std::size_t first = next;
          next = points.size() - first < most ? points.size() : first + most;
          take_in(s, points.subspan(first, next - first));
          return next < points.size();
        });
  }

  /// Number of points.
  std::size_t size() const { return points_.size(); }
  /// The points, in the order in which they were named.
  const list_of<point>& points() const { return points_; }
  /// Of each point; world, m.
  const plain_vector<vec3<double>>& positions() const { return positions_; }
  /// Of each point's observations; one more than there are points.
  const plain_vector<std::int32_t>& offsets() const { return offsets_; }
  /// Of each point the observer, by number, that it refers to.
  const plain_vector<std::int32_t>& references() const { return references_; }
  /// Of all points; of each in the order in which its observers were inserted into the map.
  const plain_vector<point_observation>& observations() const { return observations_; }
  /// Whoever sees the points.
  const keyframe_selection<Map>& observers() const { return observers_; }

 private:
  template <class Policy>
  void take_in(const mapping_scope<Map, Policy>& s, span<const point> points) {
    const Map& map = s.map;
    for_each_ahead<point_data::entry + point_data::views>(
        map, points.size(), [&](std::size_t i) { return points[i]; },
        [&](std::size_t, const point& p) {
          if (p == point{} || !traits::alive(map, p)) return;
          const std::size_t known = seen_.size();
          if (seen_.place(map, p) == known) take_in(s, p);
        },
        [&](const point& p) { seen_.prefetch(map, p); });
  }
  template <class Policy>
  void take_in(const mapping_scope<Map, Policy>& s, const point& p) {
    const Map& map = s.map;
    const keyframe reference = traits::reference(map, p);
    const std::size_t begin = observations_.size();
    std::size_t reference_place = id_table::none;
    bool is_seen = false, in_order = true;
    traits::for_each_observation(map, p, [&](keyframe k, std::size_t i) {
      if (k == keyframe{} || !traits::alive(map, k))
        return s.faults({map_fault::observer_not_alive, 0, traits::id(map, p), i});
      if (i >= keypoint_count_of(map, k))
        return s.faults({map_fault::keypoint_out_of_range, traits::id(map, k), traits::id(map, p), i});
      is_seen = true;
      const std::size_t at = observers_.place(map, k, s.stored, s.faults);
      if (at == id_table::none) return;
      if (k == reference) reference_place = at;
      const point_observation view{static_cast<std::int32_t>(at), static_cast<std::int32_t>(i)};
      in_order = in_order && (observations_.size() == begin || !is_before(view, observations_.back()));
      observations_.push_back(view);
    });
    if (!is_seen) return;
    if (!has_finite_position(map, p)) {
      observations_.resize(begin);
      return s.faults({map_fault::position_not_finite, 0, traits::id(map, p), 0});
    }
    if (observations_.size() == begin) return;
    if (!in_order) order_views(begin);
    points_.push_back(p);
    positions_.push_back(position_of(map, p));
    // A reference that does not see the point: its first observer stands in.
    references_.push_back(reference_place == id_table::none ? observations_[begin].keyframe
                                                            : static_cast<std::int32_t>(reference_place));
    offsets_.push_back(static_cast<std::int32_t>(observations_.size()));
  }
  /// Whether a view comes first: of the keyframe that was inserted into the map first.
  bool is_before(const point_observation& a, const point_observation& b) const {
    const std::uint64_t id_a = observers_.ids()[static_cast<std::size_t>(a.keyframe)];
    const std::uint64_t id_b = observers_.ids()[static_cast<std::size_t>(b.keyframe)];
    return id_a != id_b ? id_a < id_b : a.keypoint < b.keypoint;
  }
  /// The observations from `begin` on, whatever the order of the list: the first of equals wins. Lists are short, and mostly in that
  /// order, so each view is moved to its place among those before it.
  void order_views(std::size_t begin) {
    for (std::size_t i = begin + 1; i < observations_.size(); ++i) {
      const point_observation view = observations_[i];
      std::size_t at = i;
      for (; at > begin && is_before(view, observations_[at - 1]); --at) observations_[at] = observations_[at - 1];
      observations_[at] = view;
    }
  }

  point_numbering<Map> seen_;
  keyframe_selection<Map> observers_;
  list_of<point> points_;
  plain_vector<vec3<double>> positions_;
  plain_vector<std::int32_t> offsets_, references_;
  plain_vector<point_observation> observations_;
};

TURBOMAP_END_NAMESPACE
