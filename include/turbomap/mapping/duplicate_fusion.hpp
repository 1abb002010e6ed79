// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Duplicates of a keyframe's neighbourhood, found and fused on the user's map [TurboMap §IV-D]: snapshot, search, commit;
/// first the keyframe's points in every target, then, on the map that this left, the targets' points in the keyframe.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../context.hpp"
#include "../fusion/duplicate_search.hpp"
#include "../map/map_traits.hpp"
#include "../store/keyframe_store.hpp"
#include "appearance_update.hpp"
#include "duplicate_snapshot.hpp"
#include "fusion_commit.hpp"
#include "handle_table.hpp"
#include "keyframe_selection.hpp"
#include "timed_guard.hpp"

namespace turbomap {

/// When searches see what commits did.
enum class fusion_mode : std::uint8_t {
  snapshot,  ///< one search and one commit a pass
  serial_exact  ///< camera by camera, target by target: each search sees the commit before it, and survivors of merges have
                ///< their new descriptors at once [ORB-SLAM3]. Many small calls: for comparisons
};

/// Options of duplicate_fusion.
struct fusion_options {
  fusion_mode mode = fusion_mode::snapshot;
  duplicate_options search;
  fusion_commit_options commit;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// Make one and use it for every keyframe: its memory is reused. Of one context.
template <class Map, class Policy>
class duplicate_fusion {
 public:
  using traits = map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using store_type = keyframe_store<descriptor, camera, memory_of_t<Policy>>;

  explicit duplicate_fusion(const context<Policy>& ctx) : duplicates_(ctx), appearance_(ctx) {}

  /// The points of `query` in every target: searched and committed.
  /// \param targets  none of them the query; dead ones are passed over
  /// \throws std::invalid_argument  a keyframe that is not in the store, an option out of range, a map that contradicts
  ///         itself (inconsistent_map): in snapshot mode the map is then as it was
  fusion_summary forward(context<Policy>& ctx, Map& map, store_type& store, const handle_table& stored, keyframe query,
                         span<const keyframe> targets, const fusion_options& options, guard_times& held) {
    return pass(ctx, map, store, stored, span<const keyframe>(&query, 1), targets, options, held);
  }
  /// The points of all targets, each once, in `query`.
  fusion_summary backward(context<Policy>& ctx, Map& map, store_type& store, const handle_table& stored, keyframe query,
                          span<const keyframe> targets, const fusion_options& options, guard_times& held) {
    return pass(ctx, map, store, stored, targets, span<const keyframe>(&query, 1), options, held);
  }
  /// Points that gained observations since begin(): their appearance is due.
  const std::vector<point>& touched() const { return commit_.touched(); }
  void begin() { commit_.clear(); }

 private:
  fusion_summary pass(context<Policy>& ctx, Map& map, store_type& store, const handle_table& stored,
                      span<const keyframe> sources, span<const keyframe> targets, const fusion_options& options,
                      guard_times& held) {
    {
      const timed_guard<Map> guard(map, held);
      snapshot_.clear();
      for (const keyframe k : sources)
        if (traits::alive(map, k)) snapshot_.add_points_of(map, k);
      if (options.mode == fusion_mode::snapshot) take(map, stored, targets);
    }
    if (options.mode == fusion_mode::snapshot) return search_and_commit(ctx, map, store, -1, options, held);
    fusion_summary summary;
    const std::vector<point> points =
        snapshot_.points();  // the list is that of the start, its points are as they are by then
    for (const keyframe target : targets) {
      int cameras = 1;
      for (int c = 0; c < cameras; ++c) {
        const std::size_t survivors = commit_.survivors().size();
        {
          const timed_guard<Map> guard(map, held);
          snapshot_.clear();
          for (const point p : points) snapshot_.add_point(map, p);
          take(map, stored, span<const keyframe>(&target, 1));
        }
        summary += search_and_commit(ctx, map, store, c, options, held);
        cameras = targets_.size() == 0 ? 1 : cameras_[0];
        appearance_options update;
        update.geometry = false;  // normals and ranges at the end, with those of all touched points
        appearance_(ctx, map, store, stored,
                    span<const point>(commit_.survivors().data() + survivors, commit_.survivors().size() - survivors),
                    update, held);
      }
    }
    return summary;
  }

  /// Live targets with their poses, and which of them see the points.
  void take(const Map& map, const handle_table& stored, span<const keyframe> targets) {
    targets_.clear();
    for (const keyframe k : targets)
      if (traits::alive(map, k)) targets_.place(map, k, stored);
    snapshot_.note_observed(map, targets_);
  }

  /// \param only_camera  of every target; -1: all cameras
  fusion_summary search_and_commit(context<Policy>& ctx, Map& map, store_type& store, int only_camera,
                                   const fusion_options& options, guard_times& held) {
    {
      const auto pinned = store.pin(ctx, span<const keyframe_handle>(targets_.handles()));
      cameras_.clear();
      for (std::size_t t = 0; t < targets_.size(); ++t) cameras_.push_back(pinned[t].camera_count);
      snapshot_.mark_observed(cameras_);
      if (only_camera >= 0)
        for (std::size_t t = 0; t < targets_.size(); ++t)
          snapshot_.leave_out_other_cameras(t, cameras_[t], only_camera);
      call_.clear();
      for (std::size_t t = 0; t < targets_.size(); ++t)
        call_.push_back({pinned[t], targets_.T_cw()[t], snapshot_.skip(t)});
      find_duplicates(ctx, snapshot_.points_view(), span<const duplicate_target<descriptor, camera>>(call_),
                      options.search, duplicates_);
      duplicates_.plan(ctx, plan_);
    }
    const timed_guard<Map> guard(map, held);
    return commit_(map, span<const duplicate<typename descriptor::distance_type>>(plan_),
                   span<const keyframe>(targets_.keyframes()), span<const point>(snapshot_.points()), options.commit);
  }

  duplicates<descriptor, camera, Policy> duplicates_;
  appearance_update<Map, Policy> appearance_;
  fusion_commit<Map> commit_;
  duplicate_snapshot<Map> snapshot_;
  keyframe_selection<Map> targets_;
  std::vector<int> cameras_;
  std::vector<duplicate_target<descriptor, camera>> call_;
  std::vector<duplicate<typename descriptor::distance_type>> plan_;
};

TURBOMAP_END_NAMESPACE
