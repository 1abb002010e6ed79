// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that brings the appearance of map points (descriptor, normal, distance range) up to date with their
/// observations. The caller knows which points are due: those that moved, and those whose observations changed.

#include <cstddef>
#include <cstdint>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "keyframe_selection.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// update_appearance() on a user's map. Of one context.
template <class Map, class Policy>
class appearance_update {
 public:
  using traits = map_traits<Map>;
  using point = typename traits::point;
  using keyframe = typename traits::keyframe;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;

  explicit appearance_update(const context<Policy>& ctx) : appearances_(ctx) {}

  /// \param points  those to be updated; dead ones, unobserved ones and repetitions are passed over, and so are observers
  ///                that are not in the store
  /// \return how many were
  /// \throws inconsistent_map  a view by a keyframe or keypoint that is not there, a position that is not finite, unless the
  ///         scope notes faults: then such views and points are passed over
  /// A point whose position or observations change meanwhile keeps what fits the snapshot; whoever changed it updates it.
  std::size_t operator()(const scope& s, span<const point> points, const appearance_options& options) {
    snapshot(s, points);
    return update(s, options);
  }
  /// The points whose observations changed, and normals and ranges of those that only moved: each point once.
  std::size_t operator()(const scope& s, span<const point> changed, span<const point> moved,
                         appearance_options options) {
    std::size_t updated = (*this)(s, changed, options);
    options.descriptors = false;
    {
      const auto guard = s.guard();
      gather(s, moved);
    }
    updated += update(s, options);
    return updated;
  }

  /// Positions and observations of the points, and poses of all their observers.
  void snapshot(const scope& s, span<const point> points) {
    const auto guard = s.guard();
    seen_.clear();
    gather(s, points);
  }
  /// Throws what update_appearance() throws.
  void compute(const scope& s, const appearance_options& options) {
    const auto pinned = s.store.pin(s.ctx, span<const keyframe_handle>(observers_.handles()));
    posed_.clear();
    for (std::size_t k = 0; k < observers_.size(); ++k) posed_.push_back({pinned[k], observers_.T_cw()[k], {}});
    const appearance_view view{static_cast<int>(points_.size()), positions_.data(), offsets_.data(),
                               observations_.data(), references_.data()};
    update_appearance(s.ctx, view, span<const posed_keyframe<descriptor, camera>>(posed_), options, appearances_);
    appearances_.plan(s.ctx, updated_, descriptors_);
  }
  /// Writes what was computed to the points that are alive yet.
  void commit(const scope& s, const appearance_options& options) {
    const auto guard = s.guard();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const point p = points_[i];
      if (!traits::alive(s.map, p)) continue;
      point_appearance& u = updated_[i];
      if (!options.geometry)
        u.normal = traits::normal(s.map, p), u.min_distance = traits::min_distance(s.map, p),
        u.max_distance = traits::max_distance(s.map, p);
      traits::set_appearance(s.map, p, u.normal, u.min_distance, u.max_distance,
                             options.descriptors
                                 ? descriptors_.data() + i * static_cast<std::size_t>(descriptor::elements)
                                 : traits::descriptor_data(s.map, p));
      if constexpr (detail::map_has_v<Map, detail::map_covariance_member>)
        if (options.covariance) traits::set_covariance(s.map, p, u.covariance);
    }
  }

 private:
  struct view_of_point {
    std::uint64_t keyframe_id;
    std::size_t keypoint;
    keyframe observer;

    bool before(const view_of_point& v) const {
      return keyframe_id != v.keyframe_id ? keyframe_id < v.keyframe_id : keypoint < v.keypoint;
    }
  };

  std::size_t update(const scope& s, const appearance_options& options) {
    if (points_.empty()) return 0;
    compute(s, options);
    commit(s, options);
    return points_.size();
  }

  /// Those of the points that have not been seen since the last snapshot().
  /// In order of insertion into the map, whatever the order of the list: the first of equals wins. Lists are short, and mostly
  /// in that order, so each view is moved to its place among those before it.
  void order_views() {
    for (std::size_t i = 1; i < views_.size(); ++i) {
      const view_of_point v = views_[i];
      std::size_t at = i;
      for (; at > 0 && v.before(views_[at - 1]); --at) views_[at] = views_[at - 1];
      views_[at] = v;
    }
  }

  void gather(const scope& s, span<const point> points) {
    const Map& map = s.map;
    observers_.clear();
    points_.clear(), positions_.clear(), observations_.clear(), references_.clear();
    offsets_.assign(1, 0);
    for (const point p : points) {
      if (p == point{} || !traits::alive(map, p)) continue;
      const std::size_t known = seen_.size();
      if (seen_.place(map, p) != known) continue;
      views_.clear();
      traits::for_each_observation(map, p, [&](keyframe k, std::size_t i) {
        if (k == keyframe{} || !traits::alive(map, k))
          return s.faults({map_fault::observer_not_alive, 0, traits::id(map, p), i});
        if (i >= keypoint_count_of(map, k))
          return s.faults({map_fault::keypoint_out_of_range, traits::id(map, k), traits::id(map, p), i});
        views_.push_back({traits::id(map, k), i, k});
      });
      if (views_.empty()) continue;
      if (!has_finite_position(map, p)) {
        s.faults({map_fault::position_not_finite, 0, traits::id(map, p), 0});
        continue;
      }
      order_views();
      const keyframe reference = traits::reference(map, p);
      std::size_t reference_place = id_table::none, first = id_table::none;
      for (const view_of_point& v : views_) {
        const std::size_t at = observers_.place(map, v.observer, s.stored, s.faults);
        if (at == id_table::none) continue;
        if (first == id_table::none) first = at;
        if (v.observer == reference) reference_place = at;
        observations_.push_back({static_cast<std::int32_t>(at), static_cast<std::int32_t>(v.keypoint)});
      }
      if (first == id_table::none) continue;
      // A reference that does not see the point: its first observer stands in.
      if (reference_place == id_table::none) reference_place = first;
      points_.push_back(p);
      const auto& position = traits::position(map, p);
      positions_.push_back({position.x, position.y, position.z});
      references_.push_back(static_cast<std::int32_t>(reference_place));
      offsets_.push_back(static_cast<std::int32_t>(observations_.size()));
    }
  }

  appearances<descriptor, camera, Policy> appearances_;
  point_numbering<Map> seen_;
  keyframe_selection<Map> observers_;
  list_of<view_of_point> views_;
  list_of<point> points_;
  plain_vector<vec3<double>> positions_;
  plain_vector<std::int32_t> offsets_, references_;
  plain_vector<point_observation> observations_;
  plain_vector<posed_keyframe<descriptor, camera>> posed_;
  plain_vector<point_appearance> updated_;
  plain_vector<typename descriptor::element> descriptors_;
};

TURBOMAP_END_NAMESPACE
