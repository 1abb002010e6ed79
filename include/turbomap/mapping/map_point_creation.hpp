// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that makes map points of the matches that neighbour_search found: joins the matches of one landmark, estimates
/// its position from all its views (or from each pair of them), tests it, computes what it looks like, and inserts it into
/// the map.

#include <cstddef>
#include <cstdint>

#include "../appearance/update_appearance.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../matching/first_claims.hpp"
#include "../matching/point_creation.hpp"
#include "../matching/track_creation.hpp"
#include "../plain_sort.hpp"
#include "../plain_vector.hpp"
#include "creation_commit.hpp"
#include "keyframe_selection.hpp"
#include "look_again.hpp"
#include "neighbour_search.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// create_track_points() or create_points() on a user's map, as creation_options::rule says. Its snapshot is
/// neighbour_search's. Of one context.
template <class Map, class Policy>
class map_point_creation {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  using search_type = neighbour_search<Map, Policy>;
  /// @}

  /// \param ctx  its resource gives the memory, and must outlive this
  explicit map_point_creation(const context<Policy>& ctx)
      : pairs_(ctx), tracks_(ctx), track_points_(ctx), appearances_(ctx) {}

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
    created_.clear(), due_.clear();  // also where it throws before commit()
    positions_.clear(), observations_.clear(), references_.clear();
    offsets_.assign(1, 0);
    summary_ = {}, matches_ = 0;
    if (options.rule == creation_rule::tracks)
      compute_tracks(s.ctx, search, options);
    else
      compute_pairs(s.ctx, search, options);
    describe(s.ctx, search, appearance);
  }
  /// Inserts the accepted points with those of their keypoints that are free yet, in parts between which others may enter. None,
  /// or no more, once somebody has moved a keyframe since it was read, e.g. by closing a loop: the positions are of another map
  /// then. What was inserted before an exception is in created().
  void commit(const scope& s, const search_type& search) {
    created_.clear(), due_.clear();
    require(s.points_read_per_guard >= 0, "points_read_per_guard", s.points_read_per_guard, "must not be negative");
    // To insert a point takes several times as long as to read one.
    const auto read = static_cast<std::size_t>(s.points_read_per_guard);
    const std::size_t count = positions_.size(), most = read == 0 ? count : (read + 3) / 4;
    std::size_t at = 0;
    do {
      const auto guard = s.commit_guard();
      if (!is_where_it_was(s.map, search.selection())) return;
      commit_points<Map>(s.map, new_points_view{positions_, offsets_, observations_}, {look_, descriptors_},
                         search.selection().keyframes(), created_, due_, s.faults, {at, at + most});
      at += most;
    } while (at < count);
  }

  /// The points that the last call inserted.
  const list_of<point>& created() const { return created_; }
  /// New points of the last call that entered the map with fewer observations than they were described with.
  const list_of<point>& due() const { return due_; }
  /// Correspondences that the last call used.
  std::size_t matches() const { return matches_; }
  /// What became of the matches of the last call.
  const creation_summary& summary() const { return summary_; }

 private:
  /// Whether all keyframes of the search that are alive have the poses that were read.
  static bool is_where_it_was(const Map& map, const keyframe_selection<Map>& selection) {
    for (std::size_t n = 0; n < selection.size(); ++n) {
      look_again(map, selection[n]);
      if (!map_traits<Map>::alive(map, selection[n])) continue;
      if (!is_same_pose(pose_of(map, selection[n]), selection.T_cw()[n])) return false;
    }
    return true;
  }
  void compute_pairs(context<Policy>& ctx, const search_type& search, const creation_options& options) {
    create_points(ctx, search.matches(), options, pairs_);
    pairs_.plan(ctx, search.matches(), plan_);
    const std::int32_t own = search.matches().view().own_neighbour;  // the last one: pairs are of two keyframes
    while (!plan_.empty() && plan_.back().neighbour == own) plan_.pop_back();
    matches_ = plan_.size();
    claimed_.clear();
    for (const auto& k : search.posed()) claimed_.add_keyframe(k.view.keypoint_count);
    first_claims(plan_, claimed_, first_);  // none but these can enter the map: the others need no appearance
    for (const created_point& p : first_) {
      const point_observation pair[]{{0, p.query}, {1 + p.neighbour, p.candidate}};
      accept(p.position, {pair, 2});
    }
  }
  void compute_tracks(context<Policy>& ctx, const search_type& search, const creation_options& options) {
    join_tracks(ctx, search.matches(), tracks_);
    create_track_points(ctx, search.matches(), tracks_, options, track_points_, search.points());
    track_points_.plan(ctx, points_, kept_);
    const track_list& tracks = tracks_.tracks();
    matches_ = tracks_.plan().size(), summary_.tracks = tracks.size();
    for (const match_outcome o : tracks.outcomes) summary_.contradictions += o == match_outcome::contradicts ? 1 : 0;
    for (std::size_t t = 0; t < points_.size(); ++t) {
      if (points_[t].outcome == creation_outcome::known) ++summary_.known;
      if (points_[t].outcome != creation_outcome::accepted) continue;
      const auto end = static_cast<std::size_t>(tracks.offsets[t + 1]);
      views_.clear();
      for (auto v = static_cast<std::size_t>(tracks.offsets[t]); v < end; ++v)
        if (kept_[v] != 0) views_.push_back({tracks.views[v].keyframe, tracks.views[v].keypoint});
      summary_.views_left_out += end - static_cast<std::size_t>(tracks.offsets[t]) - views_.size();
      accept(points_[t].position, views_);
    }
  }
  void accept(const vec3<double>& position, span<const point_observation> views) {
    positions_.push_back(position);
    references_.push_back(views[0].keyframe);
    observations_.append(views.data(), views.size());
    offsets_.push_back(static_cast<std::int32_t>(observations_.size()));
  }

  /// As if the views of each point were in the map already. Covariances too: a later update sums the views in this order, so it
  /// gives the same bits.
  void describe(context<Policy>& ctx, const search_type& search, const appearance_options& options) {
    const auto& ids = search.selection().ids();
    // In order of insertion into the map: of equal descriptors the first wins.
    in_order_ = observations_;
    for (std::size_t i = 0; i < positions_.size(); ++i)
      sort_plain(in_order_.begin() + offsets_[i], static_cast<std::size_t>(offsets_[i + 1] - offsets_[i]),
                 [&](const point_observation& a, const point_observation& b) {
                   return a.keyframe != b.keyframe
                              ? ids[static_cast<std::size_t>(a.keyframe)] < ids[static_cast<std::size_t>(b.keyframe)]
                              : a.keypoint < b.keypoint;
                 });
    const appearance_view view{static_cast<int>(positions_.size()), positions_.data(), offsets_.data(),
                               in_order_.data(), references_.data()};
    update_appearance(ctx, view, search.posed(), options, appearances_);
    appearances_.plan(ctx, look_, descriptors_);
  }

  point_creation<Policy> pairs_;
  match_tracks<descriptor, camera, Policy> tracks_;
  track_creation<Policy> track_points_;
  appearances<descriptor, camera, Policy> appearances_;
  plain_vector<created_point> plan_, first_;
  plain_vector<created_track> points_;
  plain_vector<std::uint8_t> kept_;
  claimed_keypoints claimed_;
  plain_vector<point_observation> views_;
  std::size_t matches_ = 0;
  creation_summary summary_;
  list_of<point> created_, due_;
  // Of the accepted points.
  plain_vector<vec3<double>> positions_;
  plain_vector<std::int32_t> offsets_, references_;
  plain_vector<point_observation> observations_, in_order_;  ///< the same, in_order_ by keyframe id
  plain_vector<point_appearance> look_;
  plain_vector<typename descriptor::element> descriptors_;
};

TURBOMAP_END_NAMESPACE
