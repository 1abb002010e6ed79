// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a correspondence search: it stays where the policy runs, ready for filters and point creation; the plan,
/// its host form, is asked for last.

#include <cstdint>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Matches of one query keyframe against its neighbours, with the inputs they were found in (views, poses, masks). Make one
/// and use it for every call: its memory is reused. The keyframes that the views point to must stay where they are until the
/// last use of the result. Move-only; not shared between threads.
template <class Descriptor, class Camera, class Policy>
class correspondences {
 public:
  using memory_type = memory_of_t<Policy>;
  using distance_type = typename Descriptor::distance_type;
  using plan_type = std::vector<correspondence<distance_type>>;

  explicit correspondences(const context<Policy>& ctx)
      : inputs_(ctx.resource()), pairs_(ctx.resource()), match_(ctx.resource()), distance_(ctx.resource()) {}
  correspondences(correspondences&&) = default;
  correspondences& operator=(correspondences&&) = default;

  /// What kernels, filters and point creation read, in the memory of the policy.
  const search_view<Descriptor, Camera>& view() const { return view_; }

  /// The matches on the host in (neighbour, query keypoint) order, equal on every policy. Waits for the search. O(slots).
  plan_type plan(context<Policy>& ctx) const {
    plan_type result;
    plan(ctx, result);
    return result;
  }
  /// The same into a vector that is reused.
  void plan(context<Policy>& ctx, plan_type& result) const {
    download(ctx, host_match_);
    host_distance_.resize(host_match_.size());
    copy_out(ctx.policy(), host_distance_.data(), view_.distance, host_match_.size() * sizeof(distance_type));
    ctx.synchronize();
    result.clear();
    for (std::size_t i = 0; i < host_match_.size(); ++i)
      if (host_match_[i] != no_match)
        result.push_back({static_cast<std::int32_t>(i / static_cast<std::size_t>(view_.slot_count)),
                          queries_[i % static_cast<std::size_t>(view_.slot_count)], host_match_[i], host_distance_[i]});
  }
  /// The raw candidates on the host, [neighbour][slot], no_match where there is none; read it after ctx.synchronize().
  void download(context<Policy>& ctx, std::vector<std::int32_t>& match) const {
    match.resize(static_cast<std::size_t>(view_.neighbour_count) * static_cast<std::size_t>(view_.slot_count));
    copy_out(ctx.policy(), match.data(), view_.match, match.size() * sizeof(std::int32_t));
  }
  /// Keypoints without a map point of all neighbours together.
  std::size_t candidate_count() const { return static_cast<std::size_t>(candidate_count_); }
  /// Keypoints of all neighbours together.
  std::size_t neighbour_keypoint_count() const { return static_cast<std::size_t>(neighbour_keypoint_count_); }
  /// Every keyframe came with the angles of its keypoints.
  bool has_angles() const { return has_angles_; }
  /// Query keypoints without a map point, ascending: the slots of the result.
  const std::vector<std::int32_t>& queries() const { return queries_; }

 private:
  template <class D, class C, class P>
  friend class search_setup;

  search_view<Descriptor, Camera> view_{};
  array<std::byte, memory_type> inputs_;
  array<pair_geometry, memory_type> pairs_;
  array<std::int32_t, memory_type> match_;
  array<distance_type, memory_type> distance_;
  std::vector<std::int32_t> queries_;
  std::int64_t candidate_count_ = 0;
  std::int64_t neighbour_keypoint_count_ = 0;
  bool has_angles_ = false;
  mutable std::vector<std::int32_t> host_match_;
  mutable std::vector<distance_type> host_distance_;
};

TURBOMAP_END_NAMESPACE
