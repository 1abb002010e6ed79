// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search bodies that need no tables: one (neighbour, query keypoint) an index, all candidates or those of its visual
/// word group, under any policy. They define the answer; the ordered search gives the same one faster on the host.

#include "../config.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index i = neighbour * slot_count + slot. Compares with every keypoint without a map point.
template <class Descriptor, class Camera>
struct exhaustive_search {
  search_view<Descriptor, Camera> search;

  TURBOMAP_HD void operator()(int i) const {
    const int n = i / search.slot_count, keypoint = search.queries[i % search.slot_count];
    const auto& neighbour = search.neighbour(n);
    const auto* descriptor = search.query().descriptor_of(keypoint);
    candidate_scan<Descriptor, Camera> scan(search, n, keypoint);
    for (int k = search.candidate_offset[n]; k < search.candidate_offset[n + 1]; ++k) {
      const std::int32_t c = search.candidates[k];
      const auto d = Descriptor::distance(descriptor, neighbour.descriptor_of(c));
      if (d <= scan.best_distance()) scan.consider(c, d);
    }
    search.match[i] = scan.best();
    search.distance[i] = scan.best_distance();
  }
};

/// Index of `group` among the ascending ids, or -1.
TURBOMAP_HD inline int find_group(const group_index_view& groups, std::uint32_t group) {
  int low = 0, high = groups.group_count;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (groups.ids[middle] < group)
      low = middle + 1;
    else
      high = middle;
  }
  return low < groups.group_count && groups.ids[low] == group ? low : -1;
}

/// Index i = neighbour * (groups of the query) + group: the query keypoints of one visual word against the neighbour's
/// keypoints of the same word. Every slot of `match` must hold no_match before.
template <class Descriptor, class Camera>
struct grouped_search {
  search_view<Descriptor, Camera> search;
  const std::int32_t* slot_of_query;  ///< keypoint -> slot, or -1 where it holds a map point
  int query_groups;

  TURBOMAP_HD void operator()(int i) const {
    const int n = i / query_groups, group = i % query_groups;
    const auto& query = search.query();
    const auto& neighbour = search.neighbour(n);
    const int other = find_group(neighbour.groups, query.groups.ids[group]);
    if (other < 0) return;
    const std::uint8_t* has_point = search.has_point + search.has_point_offset[n];
    const auto& mine = query.groups;
    const auto& theirs = neighbour.groups;
    for (std::uint32_t q = mine.offsets[group]; q < mine.offsets[group + 1]; ++q) {
      const int keypoint = static_cast<int>(mine.keypoints[q]);
      const int slot = slot_of_query[keypoint];
      if (slot < 0) continue;
      const auto* descriptor = query.descriptor_of(keypoint);
      candidate_scan<Descriptor, Camera> scan(search, n, keypoint);
      for (std::uint32_t k = theirs.offsets[other]; k < theirs.offsets[other + 1]; ++k) {
        const std::int32_t c = static_cast<std::int32_t>(theirs.keypoints[k]);
        const auto d = Descriptor::distance(descriptor, neighbour.descriptor_of(c));
        if (d <= scan.best_distance() && has_point[c] == 0) scan.consider(c, d);
      }
      search.match[n * search.slot_count + slot] = scan.best();
      search.distance[n * search.slot_count + slot] = scan.best_distance();
    }
  }
};

TURBOMAP_END_NAMESPACE
