// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a correspondence search: it stays where the policy runs, ready for filters and point creation; the plan,
/// its host form, is asked for last.

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../plain_vector.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The memory of one search, and what the host knows about it: filled by a search, read by filters and point creation.
template <class Descriptor, class Camera, class Memory>
struct search_buffers {
  /// Takes its memory from the resource.
  explicit search_buffers(std::pmr::memory_resource* resource)
      : inputs(resource), pairs(resource), match(resource), distance(resource) {}

  /// Of the last search.
  search_view<Descriptor, Camera> view{};
  array<std::byte, Memory> inputs;                             ///< the arguments of the call, packed
  array<pair_geometry, Memory> pairs;                          ///< [neighbour][query camera][neighbour camera]
  array<std::int32_t, Memory> match;                           ///< [neighbour][slot]
  array<typename Descriptor::distance_type, Memory> distance;  ///< [neighbour][slot]
  plain_vector<std::int32_t> queries;   ///< query keypoints without a map point, ascending: the slots
  std::size_t neighbour_keypoints = 0;  ///< of all neighbours together
  bool has_angles = false;              ///< every keyframe came with the angles of its keypoints
};

/// Matches of one query keyframe against its neighbours, with the inputs they were found in (views, poses, masks). Make one
/// and use it for every call: its memory is reused. The keyframes that the views point to must stay where they are until the
/// last use of the result. Move-only; not shared between threads.
template <class Descriptor, class Camera, class Policy>
class correspondences {
 public:
  /// Where the results are.
  using memory_type = memory_of_t<Policy>;
  /// Of two descriptors.
  using distance_type = typename Descriptor::distance_type;
  /// The matches on the host.
  using plan_type = std::vector<correspondence<distance_type>>;

  /// Takes its memory from the context.
  explicit correspondences(const context<Policy>& ctx) : buffers_(ctx.resource()) {}
  /// What was moved from holds nothing.
  correspondences(correspondences&&) = default;
  /// What was moved from holds nothing.
  correspondences& operator=(correspondences&&) = default;

  /// No matches: what is left where a call ran out of memory, or was stopped.
  void clear() {
    buffers_.view.neighbour_count = buffers_.view.slot_count = 0;
    buffers_.view.own_neighbour = -1;
  }
  /// What kernels, filters and point creation read, in the memory of the policy.
  const search_view<Descriptor, Camera>& view() const { return buffers_.view; }
  /// Results of the search, matched or not.
  int size() const { return view().neighbour_count * view().slot_count; }

  /// The matches on the host in (neighbour, query keypoint) order, equal on every policy. Waits for the search. O(slots).
  plan_type plan(context<Policy>& ctx) const {
    plan_type result;
    plan(ctx, result);
    return result;
  }
  /// The same into a list that is reused.
  template <class List>
  void plan(context<Policy>& ctx, List& result) const {
    const auto& search = view();
    const auto count = static_cast<std::size_t>(size());
    const std::int32_t* match = ctx.on_host(search.match, count, host_match_);
    const distance_type* distance = ctx.on_host(search.distance, count, host_distance_);
    ctx.synchronize();
    result.clear();
    for (int n = 0, i = 0; n < search.neighbour_count; ++n)
      for (int slot = 0; slot < search.slot_count; ++slot, ++i)
        if (match[i] != no_match)
          result.push_back({n, queries()[static_cast<std::size_t>(slot)], match[i], distance[i]});
  }
  /// Keypoints of all neighbours together.
  std::size_t neighbour_keypoint_count() const { return buffers_.neighbour_keypoints; }
  /// Every keyframe came with the angles of its keypoints.
  bool has_angles() const { return buffers_.has_angles; }
  /// Query keypoints without a map point, ascending: the slots of the result.
  const plain_vector<std::int32_t>& queries() const { return buffers_.queries; }
  /// For who fills them: the search, or given_correspondences().
  search_buffers<Descriptor, Camera, memory_type>& buffers() { return buffers_; }

 private:
  search_buffers<Descriptor, Camera, memory_type> buffers_;
  mutable plain_vector<std::int32_t> host_match_;
  mutable plain_vector<distance_type> host_distance_;
};

TURBOMAP_END_NAMESPACE
