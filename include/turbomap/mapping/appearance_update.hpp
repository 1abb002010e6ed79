// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that brings the appearance of map points (descriptor, normal, distance range) up to date with their
/// observations. The caller knows which points are due: those that moved, and those whose observations changed. Where the store
/// has no room for all observers at once, it works in pieces.

#include <cstddef>
#include <cstdint>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../map/map_fault.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"
#include "appearance_snapshot.hpp"
#include "in_pieces.hpp"
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
    snapshot_.read(s, moved);
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
    std::size_t at = 0;  // those of the snapshot are in the same order, some left out
    compute_in_pieces(s, options, [&](std::size_t begin) {
      for (const point_appearance& u : updated_) {
        while (!(points[at] == snapshot_.points()[begin])) ++at;
        result[at++] = u.covariance, ++begin;
      }
    });
  }

  /// Positions and observations of the points, and poses of all their observers.
  void snapshot(const scope& s, span<const point> points) {
    snapshot_.clear();
    snapshot_.read(s, points);
  }
  /// Of the points [begin, end). \param most_views  of each point, the newest ones and the reference keyframe's
  /// \throws out_of_memory  their observers have no room in the store at a time; what update_appearance() throws
  void compute(const scope& s, const appearance_options& options, std::size_t begin, std::size_t end,
               std::size_t most_views = static_cast<std::size_t>(-1)) {
    const bool all = begin == 0 && end == snapshot_.size() && most_views == static_cast<std::size_t>(-1);
    if (!all) take_piece(begin, end, most_views);
    const auto& observers = snapshot_.observers();
    const auto pinned = s.store.pin(s.ctx, span<const keyframe_handle>(all ? observers.handles() : piece_.handles));
    posed_.clear();
    for (std::size_t k = 0; k < pinned.size(); ++k)
      posed_.push_back({pinned[k], observers.T_cw()[all ? k : piece_.observers[k]], {}});
    const appearance_view view{static_cast<int>(end - begin), snapshot_.positions().data() + begin,
                               (all ? snapshot_.offsets() : piece_.offsets).data(),
                               (all ? snapshot_.observations() : piece_.observations).data(),
                               (all ? snapshot_.references() : piece_.references).data()};
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
                     s.map, next - first, [&](std::size_t i) { return snapshot_.points()[begin + first + i]; },
                     [&](std::size_t i, const point& p) { commit(s, options, first + i, p); });
                 return next < updated_.size();
               });
  }

 private:
  void commit(const scope& s, const appearance_options& options, std::size_t i, const point& p) {
    look_whether_alive(s.map, p);
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
    in_pieces(snapshot_.size(), [&](std::size_t begin, std::size_t end) {
      if (end - begin > 1)
        compute(s, options, begin, end);
      else
        compute_one(s, options, begin);
      take(begin);
    });
  }
  std::size_t update(const scope& s, const appearance_options& options) {
    compute_in_pieces(s, options, [&](std::size_t begin) { commit(s, options, begin); });
    return snapshot_.size();
  }
  void compute_one(const scope& s, const appearance_options& options, std::size_t i) {
    const auto& offsets = snapshot_.offsets();
    for (auto views = static_cast<std::size_t>(offsets[i + 1] - offsets[i]);; views = (views + 1) / 2) {
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
    const auto& offsets = snapshot_.offsets();
    const auto& references = snapshot_.references();
    const auto& observations = snapshot_.observations();
    piece_.number.assign(snapshot_.observers().size(), -1);
    piece_.observers.clear(), piece_.handles.clear();
    piece_.references.clear(), piece_.observations.clear();
    piece_.offsets.assign(1, 0);
    for (std::size_t i = begin; i < end; ++i) {
      const auto first = static_cast<std::size_t>(offsets[i]), last = static_cast<std::size_t>(offsets[i + 1]);
      for (std::size_t o = first; o < last; ++o) {
        const std::int32_t observer = observations[o].keyframe;
        if (last - o > most_views && observer != references[i]) continue;
        const auto at = static_cast<std::size_t>(observer);
        if (piece_.number[at] < 0) {
          piece_.number[at] = static_cast<std::int32_t>(piece_.observers.size());
          piece_.observers.push_back(at);
          piece_.handles.push_back(snapshot_.observers().handles()[at]);
        }
        piece_.observations.push_back({piece_.number[at], observations[o].keypoint});
      }
      piece_.references.push_back(piece_.number[static_cast<std::size_t>(references[i])]);
      piece_.offsets.push_back(static_cast<std::int32_t>(piece_.observations.size()));
    }
  }

  appearances<descriptor, camera, Policy> appearances_;
  appearance_snapshot<Map> snapshot_;
  piece piece_;
  plain_vector<posed_keyframe<descriptor, camera>> posed_;
  plain_vector<point_appearance> updated_;
  plain_vector<typename descriptor::element> descriptors_;
};

TURBOMAP_END_NAMESPACE
