// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that brings the appearance of map points (descriptor, normal, distance range) up to date with their
/// observations. The caller knows which points are due: those that moved, and those whose observations changed.
/// Longer than other stages: it works in pieces where the store has no room for all observers at once.

#include <cstddef>
#include <cstdint>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/numbering.hpp"
#include "../map/read_ahead.hpp"
#include "../map/validate.hpp"
#include "../plain_vector.hpp"
#include "in_pieces.hpp"
#include "keyframe_selection.hpp"
#include "look_again.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// update_appearance() on a user's map. Of one context.
template <class Map, class Policy>
class appearance_update {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using point = typename traits::point;
  using keyframe = typename traits::keyframe;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// \param ctx  its resource gives the memory, and must outlive this
  explicit appearance_update(const context<Policy>& ctx) : appearances_(ctx) {}

  /// \param points  those to be updated; dead ones, unobserved ones and repetitions are passed over, and so are observers
  ///                that are not in the store
  /// \return how many were
  /// \throws inconsistent_map  a view by a keyframe or keypoint that is not there, a position that is not finite, a point
  ///         that is to keep its descriptor and has none, unless the scope notes faults: then they are passed over
  /// A point whose position or observations change meanwhile keeps what fits the snapshot; whoever changed it updates it.
  std::size_t operator()(const scope& s, span<const point> points, const appearance_options& options) {
    snapshot(s, points);
    return update(s, options);
  }
  /// The points whose observations changed, and normals and ranges of those that only moved: each point once.
  std::size_t operator()(const scope& s, span<const point> changed, span<const point> moved,
                         appearance_options options) {
    std::size_t updated = (*this)(s, changed, options);
    if (moved.empty()) return updated;
    options.descriptors = false;
    read(s, moved);
    updated += update(s, options);
    return updated;
  }

  /// How well points are known by their positions, observations and poses of now, for a map that does not keep it: what
  /// operator() would write to one that does. Nothing is changed.
  /// \param result  of each point, overwritten; all 0 where it is dead, has no observer in the store, or was named before
  /// \throws what operator() throws
  void covariances(const scope& s, span<const point> points, appearance_options options,
                   plain_vector<point_covariance>& result) {
    options.descriptors = false, options.geometry = options.covariance = true;
    snapshot(s, points);
    result.assign(points.size(), {});
    std::size_t at = 0;  // points_ are in the same order, some left out
    compute_in_pieces(s, options, [&](std::size_t begin) {
      for (const point_appearance& u : updated_) {
        while (!(points[at] == points_[begin])) ++at;
        result[at++] = u.covariance, ++begin;
      }
    });
  }

  /// Positions and observations of the points, and poses of all their observers.
  void snapshot(const scope& s, span<const point> points) {
    seen_.clear();
    read(s, points);
  }
  /// Of the points [begin, end). \param most_views  of each point, the newest ones and the reference keyframe's
  /// \throws out_of_memory  their observers have no room in the store at a time; what update_appearance() throws
  void compute(const scope& s, const appearance_options& options, std::size_t begin, std::size_t end,
               std::size_t most_views = static_cast<std::size_t>(-1)) {
    const bool all = begin == 0 && end == points_.size() && most_views == static_cast<std::size_t>(-1);
    if (!all) take_piece(begin, end, most_views);
    const auto pinned = s.store.pin(s.ctx, span<const keyframe_handle>(all ? observers_.handles() : piece_.handles));
    posed_.clear();
    for (std::size_t k = 0; k < pinned.size(); ++k)
      posed_.push_back({pinned[k], observers_.T_cw()[all ? k : piece_.observers[k]], {}});
    const appearance_view view{
        static_cast<int>(end - begin), positions_.data() + begin, all ? offsets_.data() : piece_.offsets.data(),
        all ? observations_.data() : piece_.observations.data(), all ? references_.data() : piece_.references.data()};
    update_appearance(s.ctx, view, span<const posed_keyframe<descriptor, camera>>(posed_), options, appearances_);
    appearances_.plan(s.ctx, updated_, descriptors_);
  }
  /// Writes what was computed last, of the points from `begin` on, to those that are alive yet.
  void commit(const scope& s, const appearance_options& options, std::size_t begin) {
    std::size_t next = 0;
    s.in_parts([] {}, [] {},
               [&](std::size_t most) {
                 const std::size_t first = next;
                 next = updated_.size() - first < most ? updated_.size() : first + most;
                 for_each_named_ahead<point_data::entry + point_data::appearance>(
                     s.map, next - first, [&](std::size_t i) { return points_[begin + first + i]; },
                     [&](std::size_t i, const point& p) { commit(s, options, first + i, p); });
                 return next < updated_.size();
               });
  }

 private:
  void commit(const scope& s, const appearance_options& options, std::size_t i, const point& p) {
    look_at_position(s.map, p);
    if (!traits::alive(s.map, p)) return;
    point_appearance& u = updated_[i];
    if (!options.geometry)
      u.normal = traits::normal(s.map, p), u.min_distance = traits::min_distance(s.map, p),
      u.max_distance = traits::max_distance(s.map, p);
    if constexpr (detail::map_has_v<Map, detail::map_covariance_member>)
      if (options.covariance) traits::set_covariance(s.map, p, u.covariance);
    const auto write = [&](const typename descriptor::element* d) {
      traits::set_appearance(s.map, p, u.normal, u.min_distance, u.max_distance, d);
    };
    if (options.descriptors) {
      write(descriptors_.data() + i * static_cast<std::size_t>(descriptor::elements));
    } else {
      const auto& given = traits::descriptor_data(s.map, p);
      const auto* const kept = detail::elements_of<descriptor>(given);
      if (kept == nullptr) return s.faults({map_fault::no_descriptor, 0, traits::id(s.map, p), 0});
      write(kept);
    }
  }

  /// As many points at a time as the store has room for the observers of. Each point is computed by itself, so the result is
  /// the same; but a point whose own observers do not fit is described by half as many, until they do.
  /// `take(begin)` is called after each piece: updated_ is of the points from `begin` on.
  template <class Take>
  void compute_in_pieces(const scope& s, const appearance_options& options, Take take) {
    in_pieces(points_.size(), [&](std::size_t begin, std::size_t end) {
      if (end - begin > 1)
        compute(s, options, begin, end);
      else
        compute_one(s, options, begin);
      take(begin);
    });
  }
  std::size_t update(const scope& s, const appearance_options& options) {
    compute_in_pieces(s, options, [&](std::size_t begin) { commit(s, options, begin); });
    return points_.size();
  }
  void compute_one(const scope& s, const appearance_options& options, std::size_t i) {
    for (auto views = static_cast<std::size_t>(offsets_[i + 1] - offsets_[i]);; views = (views + 1) / 2) {
      try {
        return compute(s, options, i, i + 1, views);
      } catch (const out_of_memory&) {
        if (views <= 1) throw;
      }
    }
  }

  /// What a call on the points [begin, end) takes: their observers numbered anew.
  struct piece {
    plain_vector<std::int32_t> number;    ///< of each observer of the snapshot in the piece; -1: none
    plain_vector<std::size_t> observers;  ///< of the snapshot
    plain_vector<keyframe_handle> handles;
    plain_vector<std::int32_t> offsets, references;
    plain_vector<point_observation> observations;
  };
  void take_piece(std::size_t begin, std::size_t end, std::size_t most_views) {
    piece_.number.assign(observers_.size(), -1);
    piece_.observers.clear(), piece_.handles.clear();
    piece_.references.clear(), piece_.observations.clear();
    piece_.offsets.assign(1, 0);
    for (std::size_t i = begin; i < end; ++i) {
      const auto first = static_cast<std::size_t>(offsets_[i]), last = static_cast<std::size_t>(offsets_[i + 1]);
      for (std::size_t o = first; o < last; ++o) {
        const std::int32_t observer = observations_[o].keyframe;
        if (last - o > most_views && observer != references_[i]) continue;
        const auto at = static_cast<std::size_t>(observer);
        if (piece_.number[at] < 0) {
          piece_.number[at] = static_cast<std::int32_t>(piece_.observers.size());
          piece_.observers.push_back(at);
          piece_.handles.push_back(observers_.handles()[at]);
        }
        piece_.observations.push_back({piece_.number[at], observations_[o].keypoint});
      }
      piece_.references.push_back(piece_.number[static_cast<std::size_t>(references_[i])]);
      piece_.offsets.push_back(static_cast<std::int32_t>(piece_.observations.size()));
    }
  }

  /// Those of the points that have not been seen since the last snapshot(). If somebody has moved an observer between two parts,
  /// poses and positions are read anew, so that all are of one time.
  void read(const scope& s, span<const point> points) {
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
          gather(s, points.subspan(first, next - first));
          return next < points.size();
        });
  }
  void gather(const scope& s, span<const point> points) {
    const Map& map = s.map;
    for_each_ahead<point_data::entry + point_data::views>(
        map, points.size(), [&](std::size_t i) { return points[i]; },
        [&](std::size_t, const point& p) {
          if (p == point{} || !traits::alive(map, p)) return;
          const std::size_t known = seen_.size();
          if (seen_.place(map, p) == known) gather(s, p);
        },
        [&](const point& p) { seen_.prefetch(map, p); });
  }
  void gather(const scope& s, const point& p) {
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
    const auto& position = traits::position(map, p);
    positions_.push_back({position.x, position.y, position.z});
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

  appearances<descriptor, camera, Policy> appearances_;
  point_numbering<Map> seen_;
  keyframe_selection<Map> observers_;
  list_of<point> points_;
  plain_vector<vec3<double>> positions_;
  plain_vector<std::int32_t> offsets_, references_;
  plain_vector<point_observation> observations_;
  piece piece_;
  plain_vector<posed_keyframe<descriptor, camera>> posed_;
  plain_vector<point_appearance> updated_;
  plain_vector<typename descriptor::element> descriptors_;
};

TURBOMAP_END_NAMESPACE
