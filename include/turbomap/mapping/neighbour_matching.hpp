// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Correspondences of one keyframe with its neighbours on the user's map, and the points that come of them: snapshot, search,
/// creation, commit.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../map/map_traits.hpp"
#include "../matching/correspondence_search.hpp"
#include "../matching/neighbour_rules.hpp"
#include "../matching/point_creation.hpp"
#include "../store/keyframe_store.hpp"
#include "../store/posed_keyframe.hpp"
#include "creation_commit.hpp"
#include "handle_table.hpp"
#include "keyframe_selection.hpp"
#include "timed_guard.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Make one and use it for every keyframe: its memory is reused. Of one context.
template <class Map, class Policy>
class neighbour_matching {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using store_type = keyframe_store<descriptor, camera, memory_of_t<Policy>>;
  using matches_type = correspondences<descriptor, camera, Policy>;

  explicit neighbour_matching(const context<Policy>& ctx) : matches_(ctx), creation_(ctx), appearances_(ctx) {}

  /// Snapshot: poses and masks of the keyframe and of those neighbours whose baseline suffices, no more than `limit`. The
  /// caller holds the guard. \param stereo_baseline  m; 0: monocular. Returns how many neighbours there are.
  std::size_t gather(const Map& map, const handle_table& stored, keyframe query, span<const keyframe> neighbours,
                     double stereo_baseline, const neighbour_options& rule, std::size_t limit) {
    selection_.clear();
    stored.at(traits::id(map, query));  // throws when it is not there
    selection_.place(map, query, stored);
    const rigid_transform<double> T_query = selection_.T_cw()[0];  // a copy: the list grows
    for (const keyframe n : neighbours) {
      if (selection_.size() > limit) break;
      if (suffices(map, T_query, n, stereo_baseline, rule)) selection_.place(map, n, stored);
    }
    masks_.resize(std::max(masks_.size(), selection_.size()));
    for (std::size_t k = 0; k < selection_.size(); ++k) {
      auto& mask = masks_[k];
      mask.resize(traits::keypoint_count(map, selection_[k]));
      for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = !(traits::point_at(map, selection_[k], i) == point{});
    }
    return selection_.size() - 1;
  }

  /// Searches what was gathered. Waits for the end. The matches stay until the next search.
  void search(context<Policy>& ctx, store_type& store, const search_options& options) {
    pinned_.clear();
    pinned_.push_back(store.pin(ctx, span<const keyframe_handle>(selection_.handles())));
    posed_.clear();
    for (std::size_t k = 0; k < selection_.size(); ++k)
      posed_.push_back({pinned_[0][k], selection_.T_cw()[k], span<const std::uint8_t>(masks_[k])});
    search_again(ctx, options, matches_);
    ctx.synchronize();
  }

  /// The same keyframes with other options, into another result: while they are pinned.
  void search_again(context<Policy>& ctx, const search_options& options, matches_type& result) const {
    require(!pinned_.empty(), "keyframes of the search", pinned_.size(), "have been released");
    search_correspondences(ctx, posed_[0],
                           span<const posed_keyframe<descriptor, camera>>(posed_.data() + 1, posed_.size() - 1),
                           options, result);
  }

  /// Creates points of the matches, computes what they look like, and commits them with it.
  /// \param created  appended. Returns the number of matches
  std::size_t create(context<Policy>& ctx, Map& map, const creation_options& options,
                     const appearance_options& appearance, std::vector<point>& created, guard_times& held) {
    create_points(ctx, matches_, options, creation_);
    creation_.plan(ctx, matches_, plan_);
    accepted_.clear();
    for (const created_point& p : plan_)
      if (p.outcome == creation_outcome::accepted) accepted_.push_back(p);
    describe(ctx, appearance);
    release();
    const timed_guard<Map> guard(map, held);
    commit_points<Map>(map, accepted_, {look_, descriptors_}, selection_[0],
                       span<const keyframe>(selection_.keyframes().data() + 1, selection_.size() - 1), created);
    return plan_.size();
  }
  /// Gives the keyframes back to the store.
  void release() { pinned_.clear(); }

  /// The last search: number 0 of the selection is the query, 1 + n is neighbour n. Its keyframes are pinned until create() or
  /// release().
  const matches_type& matches() const { return matches_; }
  const keyframe_selection<Map>& selection() const { return selection_; }
  const std::vector<created_point>& plan() const { return plan_; }

 private:
  /// The appearance of the accepted points: as if the two views of each were in the map already.
  void describe(context<Policy>& ctx, const appearance_options& options) {
    positions_.clear(), observations_.clear(), references_.assign(accepted_.size(), 0);  // number 0 is the query
    offsets_.assign(1, 0);
    for (const created_point& p : accepted_) {
      const std::size_t neighbour = 1 + static_cast<std::size_t>(p.neighbour);
      point_observation first{0, p.query}, second{static_cast<std::int32_t>(neighbour), p.candidate};
      // In order of insertion into the map: of equal descriptors the first wins.
      if (selection_.ids()[neighbour] < selection_.ids()[0]) std::swap(first, second);
      observations_.push_back(first), observations_.push_back(second);
      offsets_.push_back(static_cast<std::int32_t>(observations_.size()));
      positions_.push_back(p.position);
    }
    const appearance_view view{static_cast<int>(accepted_.size()), positions_.data(), offsets_.data(),
                               observations_.data(), references_.data()};
    update_appearance(ctx, view, span<const posed_keyframe<descriptor, camera>>(posed_), options, appearances_);
    appearances_.plan(ctx, look_, descriptors_);
  }

  bool suffices(const Map& map, const rigid_transform<double>& T_query, keyframe n, double stereo_baseline,
                const neighbour_options& rule) {
    const auto T_n = pose_of(map, n);
    if (stereo_baseline > 0) return baseline_suffices_stereo(T_query, T_n, stereo_baseline);
    points_.clear();
    for (std::size_t i = 0; i < traits::keypoint_count(map, n); ++i) {
      const point p = traits::point_at(map, n, i);
      if (p == point{}) continue;
      const auto& x = traits::position(map, p);
      points_.push_back({x.x, x.y, x.z});
    }
    return baseline_suffices_monocular(T_query, T_n, median_depth(T_n, points_, depths_), rule);
  }

  matches_type matches_;
  point_creation<Policy> creation_;
  keyframe_selection<Map> selection_;
  std::vector<std::vector<std::uint8_t>> masks_;
  std::vector<pinned_keyframes<descriptor, camera, memory_of_t<Policy>>> pinned_;
  std::vector<posed_keyframe<descriptor, camera>> posed_;
  std::vector<created_point> plan_, accepted_;
  appearances<descriptor, camera, Policy> appearances_;
  // Of the accepted points.
  std::vector<vec3<double>> positions_;
  std::vector<std::int32_t> offsets_, references_;
  std::vector<point_observation> observations_;
  std::vector<point_appearance> look_;
  std::vector<typename descriptor::element> descriptors_;
  std::vector<vec3<double>> points_;
  std::vector<double> depths_;
};

TURBOMAP_END_NAMESPACE
