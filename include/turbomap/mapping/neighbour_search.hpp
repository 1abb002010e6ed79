// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that finds keypoint correspondences of a keyframe with its neighbours: the best covisible keyframes whose
/// baseline is long enough to triangulate. All neighbours are searched in one call; the matches stay for the stage that
/// makes points of them.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "../map/neighbourhood.hpp"
#include "../map/numbering.hpp"
#include "../matching/correspondence_search.hpp"
#include "../matching/creation_plan.hpp"
#include "../matching/neighbour_rules.hpp"
#include "../plain_vector.hpp"
#include "../store/posed_keyframe.hpp"
#include "keyframe_selection.hpp"
#include "neighbour_search_options.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// search_correspondences() on a user's map. Its commit is map_point_creation's. Of one context.
template <class Map, class Policy>
class neighbour_search {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  using matches_type = correspondences<descriptor, camera, Policy>;
  /// @}

  /// \param ctx  its resource gives the memory, and must outlive this
  explicit neighbour_search(const context<Policy>& ctx) : matches_(ctx) {}

  /// Poses and masks of the keyframe and of its neighbours whose baseline suffices. Nothing, an empty selection(), if the
  /// keyframe was erased meanwhile: compute() has nothing to search then.
  /// \param fitting  fitting(n): how many of n neighbours may be taken, e.g. by a deadline
  /// \return whether neighbours were left out for fitting(), which may have been too near to be searched
  /// \throws std::invalid_argument  the keyframe is not in the store or has no pose; an option out of range
  template <class Fitting>
  bool snapshot(const scope& s, keyframe query, const neighbour_search_options& options, Fitting fitting) {
    const auto guard = s.guard();
    selection_.clear();
    if (!traits::alive(s.map, query)) return false;
    const auto& near =
        neighbourhood_.neighbours(s.map, query, options.neighbourhood, [&](keyframe k) { return s.can_use(k); });
    const std::size_t most = fitting(near.size());
    gather(s, query, near, options, most);
    return most < near.size() && neighbour_count() == most;
  }
  /// Searches what was copied. Waits for the end. The matches stay until the next search.
  void compute(const scope& s, const search_options& options) {
    pinned_ = {};  // before others are asked for: there may be no room for both
    pinned_ = s.store.pin(s.ctx, span<const keyframe_handle>(selection_.handles()));
    posed_.clear();
    for (std::size_t k = 0; k < selection_.size(); ++k)
      posed_.push_back({pinned_[k], selection_.T_cw()[k],
                        span<const std::uint8_t>(masks_.data() + begin_[k], begin_[k + 1] - begin_[k])});
    compute_again(s.ctx, options, matches_);
    s.ctx.synchronize();
  }
  /// The same keyframes with other options, into another result: while they are pinned.
  void compute_again(context<Policy>& ctx, const search_options& options, matches_type& result) const {
    require(pinned_.size() > 0, "keyframes of the search", "none", "have been released");
    const auto all = posed();
    search_correspondences(ctx, all[0], all.subspan(1, all.size() - 1), options, result);
  }

  /// Gives the keyframes back to the store.
  void release() { pinned_ = {}; }

  /// Number of neighbours that were chosen.
  std::size_t neighbour_count() const { return selection_.size() == 0 ? 0 : selection_.size() - 1; }
  /// Number 0 is the query, 1 + n is neighbour n; pinned from compute() to release().
  span<const posed_keyframe<descriptor, camera>> posed() const { return posed_; }
  /// The keyframes of posed(), as the map names them.
  const keyframe_selection<Map>& selection() const { return selection_; }
  /// The matches, where the policy computes.
  const matches_type& matches() const { return matches_; }
  /// Whether search_options::stop has ended compute(): matches() then refers to no neighbours.
  bool stopped() const { return matches_.view().neighbour_count == 0 && neighbour_count() > 0; }
  /// Which points the keypoints of posed() see, if the options asked for that, and the search was not stopped.
  known_points points() const { return stopped() ? known_points{} : known_points{point_numbers_, point_offsets_}; }

 private:
  void gather(const scope& s, keyframe query, const list_of<keyframe>& neighbours,
              const neighbour_search_options& options, std::size_t most) {
    const Map& map = s.map;
    s.stored.at(traits::id(map, query));     // throws when it is not there
    selection_.place(map, query, s.stored);  // throws when it has no pose
    const rigid_transform<double> T_query = first_camera(s, query);
    for (const keyframe& n : neighbours) {
      if (selection_.size() > most) break;
      if (suffices(s, T_query, n, options)) selection_.place(map, n, s.stored);
    }
    numbers_.clear(), point_numbers_.clear(), point_offsets_.clear();
    masks_.clear(), begin_.assign(1, 0);
    for (std::size_t k = 0; k < selection_.size(); ++k) {
      begin_.push_back(begin_[k] + keypoint_count_of(map, selection_[k]));
      masks_.resize(begin_[k + 1]);
      std::uint8_t* const mask = masks_.data() + begin_[k];
      if (options.number_points) point_offsets_.push_back(static_cast<std::int32_t>(point_numbers_.size()));
      for (std::size_t i = 0; i < begin_[k + 1] - begin_[k]; ++i) {
        const point p = traits::point_at(map, selection_[k], i);
        mask[i] = !(p == point{});
        if (options.number_points)
          point_numbers_.push_back(mask[i] == 0 ? -1 : static_cast<std::int32_t>(numbers_.place(map, p)));
      }
    }
  }
  /// World to the first camera of a keyframe that is in the store: parallax and depth are a camera's, and its body may be anywhere.
  static rigid_transform<double> first_camera(const scope& s, keyframe k) {
    const auto T_camera_body = s.store.first_camera(s.stored.at(traits::id(s.map, k)));
    const auto T_cw = pose_of(s.map, k);
    if (is_same_pose(T_camera_body, rigid_transform<double>{})) return T_cw;  // to the last bit
    return to_rigid_transform(to_isometry<double>(T_camera_body) * to_isometry<double>(T_cw));
  }
  bool suffices(const scope& s, const rigid_transform<double>& T_query, keyframe n,
                const neighbour_search_options& options) {
    const Map& map = s.map;
    const auto T_n = first_camera(s, n);
    if (options.stereo_baseline > 0) return baseline_suffices_stereo(T_query, T_n, options.stereo_baseline);
    points_.clear();
    for (std::size_t i = 0; i < keypoint_count_of(map, n); ++i) {
      const point p = traits::point_at(map, n, i);
      if (!(p == point{}) && traits::alive(map, p)) points_.push_back(position_of(map, p));
    }
    return baseline_suffices_monocular(T_query, T_n, median_depth(T_n, points_, depths_), options.baseline_rule);
  }

  neighbourhood<Map> neighbourhood_;
  keyframe_selection<Map> selection_;
  plain_vector<std::uint8_t> masks_;  ///< of all keyframes: which keypoints have a point
  plain_vector<std::size_t> begin_;   ///< of each keyframe in masks_; one more than there are
  pinned_keyframes<descriptor, camera, memory_of_t<Policy>> pinned_;
  plain_vector<posed_keyframe<descriptor, camera>> posed_;
  matches_type matches_;
  point_numbering<Map> numbers_;
  plain_vector<std::int32_t> point_numbers_, point_offsets_;
  plain_vector<vec3<double>> points_;
  plain_vector<double> depths_;
};

TURBOMAP_END_NAMESPACE
