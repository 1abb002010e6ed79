// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a correspondence search: it stays where the policy runs, ready for filters and point creation; the plan,
/// its host form, is asked for last.

#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <utility>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../found_list.hpp"
#include "../plain_vector.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The memory of one search, and what the host knows about it: filled by a search, read by filters and point creation.
template <class Descriptor, class Camera, class Memory>
struct search_buffers {
  /// Takes its memory from the resource.
  explicit search_buffers(std::pmr::memory_resource* resource)
      : inputs(resource), candidates(resource), pairs(resource), match(resource), distance(resource) {}

  /// Of the last search.
  search_view<Descriptor, Camera> view{};
  array<std::byte, Memory> inputs;                             ///< the arguments of the call, packed
  array<std::int32_t, Memory> candidates;                      ///< search_view::candidate_end, then its candidates
  array<pair_geometry, Memory> pairs;                          ///< [neighbour][query camera][neighbour camera]
  array<std::int32_t, Memory> match;                           ///< [neighbour][slot]
  array<typename Descriptor::distance_type, Memory> distance;  ///< [neighbour][slot]
  plain_vector<std::int32_t> queries;          ///< query keypoints without a map point, ascending: the slots
  plain_vector<std::int32_t> keypoint_counts;  ///< of the query, then of each neighbour
  bool has_angles = false;                     ///< every keyframe came with the angles of its keypoints
};

namespace detail {

/// Index = result of a search: its match.
template <class Descriptor, class Camera>
struct match_found {
  using entry = correspondence<typename Descriptor::distance_type>;

  search_view<Descriptor, Camera> search;

  TURBOMAP_HD bool operator()(int i, entry& e) const {
    const std::int32_t candidate = search.match[i];
    if (candidate == no_match) return false;
    const int n = i / search.slot_count;
    e = {n, search.queries[i - n * search.slot_count], candidate, search.distance[i]};
    return true;
  }
};

}  // namespace detail

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
  explicit correspondences(const context<Policy>& ctx) : buffers_(ctx.resource()), list_(ctx) {}
  /// What was moved from holds nothing.
  correspondences(correspondences&& other) noexcept
      : buffers_(std::move(other.buffers_)), list_(std::move(other.list_)) {
    other.clear();
  }
  /// What was moved from holds nothing.
  correspondences& operator=(correspondences&& other) noexcept {
    if (this == &other) return *this;
    buffers_ = std::move(other.buffers_), list_ = std::move(other.list_);
    other.clear();
    return *this;
  }

  /// No matches: what is left where a call ran out of memory, or was stopped.
  void clear() {
    buffers_.view.neighbour_count = buffers_.view.slot_count = 0;
    buffers_.view.own_neighbour = -1;
    buffers_.keypoint_counts.clear(), buffers_.queries.clear();
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
    list_.read(ctx, size(), detail::match_found<Descriptor, Camera>{view()}, result);
  }
  /// Keypoints of the query, then of each neighbour.
  const plain_vector<std::int32_t>& keypoint_counts() const { return buffers_.keypoint_counts; }
  /// Keypoints of all neighbours together.
  std::size_t neighbour_keypoint_count() const {
    std::size_t count = 0;
    for (std::size_t k = 1; k < keypoint_counts().size(); ++k) count += static_cast<std::size_t>(keypoint_counts()[k]);
    return count;
  }
  /// Every keyframe came with the angles of its keypoints.
  bool has_angles() const { return buffers_.has_angles; }
  /// Query keypoints without a map point, ascending: the slots of the result.
  const plain_vector<std::int32_t>& queries() const { return buffers_.queries; }
  /// For who fills them: the search, or given_correspondences().
  search_buffers<Descriptor, Camera, memory_type>& buffers() { return buffers_; }

 private:
  search_buffers<Descriptor, Camera, memory_type> buffers_;
  mutable found_list<correspondence<distance_type>, Policy> list_;
};

TURBOMAP_END_NAMESPACE
