// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stage that finds and fuses duplicate points of a keyframe's neighbourhood [TurboMap §IV-D]. Two keyframes may have
/// made two points of one landmark. First the points of the keyframe are searched in every target; then, on the map that
/// this left, the points of the targets in the keyframe. A point that is found at a keypoint gains an observation there, or
/// is merged with the point that the keypoint sees.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../fusion/duplicate_search.hpp"
#include "../map/map_traits.hpp"
#include "../plain_vector.hpp"
#include "appearance_update.hpp"
#include "duplicate_snapshot.hpp"
#include "fusion_commit.hpp"
#include "fusion_options.hpp"
#include "in_pieces.hpp"
#include "keyframe_selection.hpp"
#include "stage.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// find_duplicates() and its commit on a user's map. Of one context.
template <class Map, class Policy>
class duplicate_fusion {
 public:
  /// @{
  /// Types of the map, as its traits name them; `scope` is what a stage is called with.
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using scope = mapping_scope<Map, Policy>;
  /// @}

  /// \param ctx  its resource gives the memory, and must outlive this
  explicit duplicate_fusion(const context<Policy>& ctx) : duplicates_(ctx), appearance_(ctx) {}

  /// The points of `query` in every target: searched and committed.
  /// \param targets  none of them the query; dead ones are passed over
  /// \throws std::invalid_argument  a keyframe that is not in the store, an option out of range, a map that contradicts
  ///         itself (inconsistent_map): what options.commit.entries_per_guard calls a part is then not applied, the parts
  ///         before it are
  fusion_summary forward(const scope& s, keyframe query, span<const keyframe> targets, const fusion_options& options) {
    return pass(s, span<const keyframe>(&query, 1), targets, options);
  }
  /// The points of all targets, each once, in `query`.
  fusion_summary backward(const scope& s, keyframe query, span<const keyframe> targets, const fusion_options& options) {
    return pass(s, targets, span<const keyframe>(&query, 1), options);
  }
  /// Points that gained observations since begin(): their appearance is due.
  const list_of<point>& touched() const { return commit_.touched(); }
  /// What was done since begin(), also by a call that threw after some of its parts.
  const fusion_summary& done() const { return done_; }
  /// Begins with a new keyframe: nothing is done, and no point has been touched.
  void begin() { commit_.clear(), done_ = {}; }

 private:
  static constexpr int all_cameras = -1;

  fusion_summary pass(const scope& s, span<const keyframe> sources, span<const keyframe> targets,
                      const fusion_options& options) {
    if (options.mode == fusion_mode::serial_exact) return serial_pass(s, sources, targets, options);
    snapshot(s, sources, targets, options);
    compute_covariances(s, options);
    compute(s, all_cameras, options.search);
    return commit(s, options.commit);
  }

  /// The list of points is that of the start; the points are as they are by then.
  fusion_summary serial_pass(const scope& s, span<const keyframe> sources, span<const keyframe> targets,
                             const fusion_options& options) {
    {
      const auto guard = s.guard();
      snapshot_points(s, sources, options);
    }
    const list_of<point> points = snapshot_.points();
    fusion_summary summary;
    for (const keyframe& target : targets) {
      int cameras = 1;
      for (int c = 0; c < cameras; ++c) {
        const std::size_t survivors = commit_.survivors().size();
        {
          const auto guard = s.guard();
          snapshot_.clear(options.covariances);
          for (const point& p : points) snapshot_.add_point(s.map, p, s.faults);
          place_targets(s, span<const keyframe>(&target, 1));
          if (targets_.size() == 1) snapshot_.note_observed_by(s.map, targets_[0]);
        }
        compute_covariances(s, options);
        compute(s, c, options.search);
        summary += commit(s, options.commit);
        cameras = targets_.size() == 0 ? 1 : cameras_[0];
        appearance_options update;
        update.geometry = false;  // normals and ranges at the end, with those of all touched points
        appearance_(s,
                    span<const point>(commit_.survivors().data() + survivors, commit_.survivors().size() - survivors),
                    update);
      }
    }
    return summary;
  }

  /// Live targets with their poses, the live points of live sources, and which targets see them. Each point is read at once; if
  /// somebody has moved a target between two parts, poses and positions are read anew, so that all are of one time.
  void snapshot(const scope& s, span<const keyframe> sources, span<const keyframe> targets,
                const fusion_options& options) {
    std::size_t source = 0, slot = 0;
    s.in_parts(
        [&] {
          snapshot_.clear(options.covariances);
          place_targets(s, targets);
        },
        [&] {
          if (targets_.read_poses(s.map)) snapshot_.read_positions(s.map);
        },
        [&](std::size_t most) {
          const std::size_t known = snapshot_.points().size();
          for (; source < sources.size() && most > 0; ++source, slot = 0) {
            if (!traits::alive(s.map, sources[source])) continue;
            const std::size_t slots = keypoint_count_of(s.map, sources[source]), begin = slot;
            slot = slots - begin < most ? slots : begin + most;
            snapshot_.add_points_of(s.map, sources[source], begin, slot, s.faults);
            most -= slot - begin;
            if (slot < slots) break;
          }
          const bool more = source < sources.size();
          if (targets_.size() != 1)
            snapshot_.note_observed(s.map, targets_, s.faults, known);
          else if (!more)
            snapshot_.note_observed_by(s.map, targets_[0]);
          return more;
        });
  }
  /// The live points of live keyframes. The caller holds the guard.
  void snapshot_points(const scope& s, span<const keyframe> sources, const fusion_options& options) {
    snapshot_.clear(options.covariances);
    for (const keyframe& k : sources)
      if (traits::alive(s.map, k)) snapshot_.add_points_of(s.map, k, s.faults);
  }
  /// Live targets with their poses. The caller holds the guard.
  void place_targets(const scope& s, span<const keyframe> targets) {
    targets_.clear();
    for (const keyframe& k : targets)
      if (traits::alive(s.map, k)) targets_.place(s.map, k, s.stored, s.faults);
  }

  /// Of a map that does not keep how well its points are known: from their views.
  void compute_covariances([[maybe_unused]] const scope& s, [[maybe_unused]] const fusion_options& options) {
    if constexpr (!detail::map_has_v<Map, detail::map_covariance_member>) {
      if (!options.covariances) return;
      appearance_options views;
      views.scales = options.search.scales, views.stereo_correlation = options.stereo_correlation;
      appearance_.covariances(s, snapshot_.points(), views, snapshot_.covariances());
    }
  }
  /// Searches the points in the targets, as many targets at a time as the store has room for: each is searched by itself, so
  /// the plan is the same. \param only_camera  of every target, or all_cameras
  void compute(const scope& s, int only_camera, const duplicate_options& options) {
    plan_.clear();
    in_pieces(targets_.size(), [&](std::size_t begin, std::size_t end) {
      search_targets(s, begin, end, only_camera, options);
      for (auto& d : found_) d.target += static_cast<std::int32_t>(begin);
      plan_.append(found_.data(), found_.size());
    });
  }
  void search_targets(const scope& s, std::size_t begin, std::size_t end, int only_camera,
                      const duplicate_options& options) {
    const auto pinned = s.store.pin(s.ctx, span<const keyframe_handle>(targets_.handles().data() + begin, end - begin));
    const std::size_t count = end - begin;
    cameras_.clear();
    for (std::size_t t = 0; t < count; ++t) cameras_.push_back(pinned[t].camera_count);
    snapshot_.mark_observed(cameras_, begin);
    if (only_camera != all_cameras)
      for (std::size_t t = 0; t < count; ++t) snapshot_.leave_out_other_cameras(t, cameras_[t], only_camera);
    call_.clear();
    for (std::size_t t = 0; t < count; ++t) call_.push_back({pinned[t], targets_.T_cw()[begin + t], snapshot_.skip(t)});
    find_duplicates(s.ctx, snapshot_.points_view(), span<const duplicate_target<descriptor, camera>>(call_), options,
                    duplicates_);
    duplicates_.plan(s.ctx, found_);
  }

  /// In parts: what others do to the map between two of them is met as what they did since the search.
  fusion_summary commit(const scope& s, const fusion_commit_options& options) {
    check_fusion_commit(options);
    const std::size_t most =
        options.entries_per_guard == 0 ? plan_.size() : static_cast<std::size_t>(options.entries_per_guard);
    fusion_summary summary;
    for (std::size_t begin = 0; begin < plan_.size(); begin += most) {
      const std::size_t left = plan_.size() - begin;
      const auto guard = s.commit_guard();
      const span<const duplicate<typename descriptor::distance_type>> part(plan_.data() + begin, std::min(left, most));
      try {
        commit_(s.map, part, span<const keyframe>(targets_.keyframes()), span<const point>(snapshot_.points()), options,
                s.faults);
      } catch (...) {
        done_ += commit_.done();
        throw;
      }
      summary += commit_.done(), done_ += commit_.done();
    }
    return summary;
  }

  duplicates<descriptor, camera, Policy> duplicates_;
  appearance_update<Map, Policy> appearance_;
  fusion_commit<Map> commit_;
  fusion_summary done_;
  duplicate_snapshot<Map> snapshot_;
  keyframe_selection<Map> targets_;
  plain_vector<int> cameras_;
  plain_vector<duplicate_target<descriptor, camera>> call_;
  plain_vector<duplicate<typename descriptor::distance_type>> plan_,
      found_;  ///< of all targets, of those searched last
};

TURBOMAP_END_NAMESPACE
