// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that makes map points of the matches that neighbour_search found: triangulates or back-projects every match,
/// tests the point, computes what it looks like, and inserts it into the map.

#include <cstddef>
#include <cstdint>
#include <utility>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../matching/point_creation.hpp"
#include "../plain_vector.hpp"
#include "creation_commit.hpp"
#include "neighbour_search.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// create_points() on a user's map. Its snapshot is neighbour_search's. Of one context.
template <class Map, class Policy>
class map_point_creation {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  using search_type = neighbour_search<Map, Policy>;

  explicit map_point_creation(const context<Policy>& ctx) : candidates_(ctx), appearances_(ctx) {}

  /// Points of the last search of `search`, which gives its keyframes back to the store.
  /// \return the new points, until the next call
  const list_of<point>& operator()(const scope& s, search_type& search, const creation_options& options,
                                   const appearance_options& appearance) {
    compute(s, search, options, appearance);
    search.release();
    commit(s, search);
    return created_;
  }

  /// Candidate points, and the appearance of those that are accepted.
  void compute(const scope& s, const search_type& search, const creation_options& options,
               const appearance_options& appearance) {
    create_points(s.ctx, search.matches(), options, candidates_);
    candidates_.plan(s.ctx, search.matches(), plan_);
    accepted_.clear();
    for (const created_point& p : plan_)
      if (p.outcome == creation_outcome::accepted) accepted_.push_back(p);
    describe(s.ctx, search, appearance);
  }
  /// Inserts the accepted points whose keypoints are free yet.
  void commit(const scope& s, const search_type& search) {
    const auto& keyframes = search.selection().keyframes();
    created_.clear();
    const auto guard = s.guard();
    commit_points<Map>(s.map, accepted_, {look_, descriptors_}, keyframes[0],
                       span<const keyframe>(keyframes.data() + 1, keyframes.size() - 1), created_);
  }

  /// Every match of the last call with what became of it.
  const plain_vector<created_point>& plan() const { return plan_; }

 private:
  /// As if the two views of each point were in the map already.
  void describe(context<Policy>& ctx, const search_type& search, const appearance_options& options) {
    const auto& ids = search.selection().ids();
    positions_.clear(), observations_.clear(), references_.assign(accepted_.size(), 0);  // number 0 is the query
    offsets_.assign(1, 0);
    for (const created_point& p : accepted_) {
      const std::size_t neighbour = 1 + static_cast<std::size_t>(p.neighbour);
      point_observation first{0, p.query}, second{static_cast<std::int32_t>(neighbour), p.candidate};
      // In order of insertion into the map: of equal descriptors the first wins.
      if (ids[neighbour] < ids[0]) std::swap(first, second);
      observations_.push_back(first), observations_.push_back(second);
      offsets_.push_back(static_cast<std::int32_t>(observations_.size()));
      positions_.push_back(p.position);
    }
    const appearance_view view{static_cast<int>(accepted_.size()), positions_.data(), offsets_.data(),
                               observations_.data(), references_.data()};
    update_appearance(ctx, view, search.posed(), options, appearances_);
    appearances_.plan(ctx, look_, descriptors_);
  }

  point_creation<Policy> candidates_;
  appearances<descriptor, camera, Policy> appearances_;
  plain_vector<created_point> plan_, accepted_;
  list_of<point> created_;
  // Of the accepted points.
  plain_vector<vec3<double>> positions_;
  plain_vector<std::int32_t> offsets_, references_;
  plain_vector<point_observation> observations_;
  plain_vector<point_appearance> look_;
  plain_vector<typename descriptor::element> descriptors_;
};

TURBOMAP_END_NAMESPACE
