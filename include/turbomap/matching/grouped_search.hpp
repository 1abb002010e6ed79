// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search among keypoints of the same visual word: a bag-of-words vocabulary has put the keypoints of every keyframe
/// into groups, and only members of equal groups are compared [ORB-SLAM3]. Fewer comparisons, some matches lost.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "candidate_scan.hpp"
#include "find_group.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Index = keypoint of the query: no slot.
struct clear_slot {
  std::int32_t* slot_of_query;
  TURBOMAP_HD void operator()(int i) const { slot_of_query[i] = -1; }
};
/// Index = slot.
struct set_slot {
  std::int32_t* slot_of_query;
  const std::int32_t* queries;
  TURBOMAP_HD void operator()(int i) const { slot_of_query[queries[i]] = i; }
};
/// Index = result.
template <class Descriptor, class Camera>
struct clear_match {
  search_view<Descriptor, Camera> search;
  TURBOMAP_HD void operator()(int i) const {
    search.match[i] = no_match;
    search.distance[i] = search.max_distance;
  }
};

}  // namespace detail

/// Some members of a group that may be matched. Collected before they are compared, without a branch: half of a group holds
/// map points, in no order that a processor could predict.
struct group_block {
  static constexpr int size = 64;  ///< members looked at once; a group of any size is several blocks
  std::int32_t keypoints[size];    ///< the members
  int count = 0;                   ///< how many there are

  /// Collects members of [at, end) for which free(keypoint) holds; returns where to go on.
  template <class Free>
  TURBOMAP_HD std::uint32_t collect(const index_list& members, std::uint32_t at, std::uint32_t end, Free free) {
    const std::uint32_t stop = end - at < static_cast<std::uint32_t>(size) ? end : at + size;
    count = 0;
    for (; at < stop; ++at) {
      const auto keypoint = static_cast<std::int32_t>(members[at]);
      keypoints[count] = keypoint;
      count += free(keypoint) ? 1 : 0;
    }
    return at;
  }
};

/// Index i = neighbour * (groups of the query) + group: the query keypoints of one visual word against the neighbour's
/// keypoints of the same word. Every element of `match` must hold no_match before, and of `distance` max_distance.
template <class Descriptor, class Camera>
struct grouped_search {
  search_view<Descriptor, Camera> search;  ///< what is read and written
  const std::int32_t* slot_of_query;       ///< keypoint -> slot, or -1 where it holds a map point
  int query_groups;                        ///< groups of the query

  /// Searches for the results of one group.
  TURBOMAP_HD void operator()(int i) const {
    const int n = i / query_groups, group = i % query_groups;
    const auto& mine = search.query().groups;
    const auto& theirs = search.neighbour(n).groups;
    const int other = find_group(theirs, mine.ids[group]);
    if (other < 0) return;
    const std::uint8_t* has_point = search.has_point + search.has_point_offset[n];
    const std::uint32_t last_query = mine.offsets[static_cast<std::size_t>(group) + 1];
    const std::uint32_t last_candidate = theirs.offsets[static_cast<std::size_t>(other) + 1];
    group_block queries, candidates;
    for (std::uint32_t q = mine.offsets[static_cast<std::size_t>(group)]; q < last_query;) {
      q = queries.collect(mine.keypoints, q, last_query, [&](std::int32_t k) { return slot_of_query[k] >= 0; });
      for (std::uint32_t c = theirs.offsets[static_cast<std::size_t>(other)]; c < last_candidate;) {
        c = candidates.collect(theirs.keypoints, c, last_candidate, [&](std::int32_t k) { return has_point[k] == 0; });
        for (int k = 0; k < queries.count; ++k) match(n, queries.keypoints[k], candidates);
      }
    }
  }

 private:
  TURBOMAP_HD void match(int n, std::int32_t keypoint, const group_block& candidates) const {
    const std::int64_t at = static_cast<std::int64_t>(n) * search.slot_count + slot_of_query[keypoint];
    const auto& neighbour = search.neighbour(n);
    const auto* descriptor = search.query().descriptor_of(keypoint);
    candidate_scan<Descriptor, Camera> scan(search, n, keypoint, search.match[at], search.distance[at]);
    for (int k = 0; k < candidates.count; ++k) {
      const auto d = Descriptor::distance(descriptor, neighbour.descriptor_of(candidates.keypoints[k]));
      if (d <= scan.best_distance()) scan.consider(candidates.keypoints[k], d);
    }
    search.match[at] = scan.best();
    search.distance[at] = scan.best_distance();
  }
};

/// Fills keypoint of the query -> slot, -1 where it holds a map point.
template <class Derived, class Descriptor, class Camera>
void launch_number_slots(const thrust::execution_policy<Derived>& policy, const search_view<Descriptor, Camera>& search,
                         std::int32_t* slot_of_query, int query_keypoints) {
  for_each_index(derived(policy), query_keypoints, detail::clear_slot{slot_of_query});
  for_each_index(derived(policy), search.slot_count, detail::set_slot{slot_of_query, search.queries});
}

/// No result has a match.
template <class Derived, class Descriptor, class Camera>
void launch_clear_matches(const thrust::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 detail::clear_match<Descriptor, Camera>{search});
}

/// Matches within groups, into cleared results.
template <class Derived, class Descriptor, class Camera>
void launch_search_groups(const thrust::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search, const std::int32_t* slot_of_query,
                          int query_groups) {
  for_each_index(derived(policy), search.neighbour_count * query_groups,
                 grouped_search<Descriptor, Camera>{search, slot_of_query, query_groups});
}

TURBOMAP_END_NAMESPACE
