// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a correspondence search: it stays where the policy runs, ready for filters and point creation; the plan,
/// its host form, is asked for last.

#include <cstdint>
#include <type_traits>
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

  /// No matches: what is left where a call ran out of memory.
  void clear() { view_.neighbour_count = view_.slot_count = 0; }
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
    const std::int32_t* match = on_host(ctx, view_.match, host_match_);
    const distance_type* distance = on_host(ctx, view_.distance, host_distance_);
    ctx.synchronize();
    result.clear();
    for (int n = 0, i = 0; n < view_.neighbour_count; ++n)
      for (int slot = 0; slot < view_.slot_count; ++slot, ++i)
        if (match[i] != no_match)
          result.push_back({n, queries_[static_cast<std::size_t>(slot)], match[i], distance[i]});
  }
  /// An array of the result, [neighbour][slot], for the host to read after ctx.synchronize(): copied into `buffer`, or as it
  /// is where the policy computes in host memory.
  template <class T>
  const T* on_host(context<Policy>& ctx, const T* resident, std::vector<T>& buffer) const {
    if constexpr (std::is_same_v<memory_type, host_memory>) return resident;
    buffer.resize(static_cast<std::size_t>(view_.neighbour_count) * static_cast<std::size_t>(view_.slot_count));
    copy_out(ctx.policy(), buffer.data(), resident, buffer.size() * sizeof(T));
    return buffer.data();
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
