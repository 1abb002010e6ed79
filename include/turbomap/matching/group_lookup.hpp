// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The visual word group of every keypoint of a search: the index of a keyframe lists keypoints by group, filters ask
/// the other way round.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../first_where.hpp"
#include "../types.hpp"
#include "correspondences.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Group ids, keypoint::no_group for a keypoint without one.
struct group_lookup {
  std::uint32_t* query;      ///< of query keypoints; no_group also for those that hold a map point
  std::uint32_t* neighbour;  ///< at has_point_offset[n] + keypoint
  std::int32_t query_size;   ///< keypoints beyond it hold map points
};

namespace detail {

/// Position `p` of the keypoints of all groups -> its group.
TURBOMAP_HD inline int group_at(const group_index_view& groups, std::uint32_t p) {
  return first_where(1, groups.group_count, [&](int g) { return groups.offsets[static_cast<std::size_t>(g)] > p; }) - 1;
}
TURBOMAP_HD inline std::uint32_t grouped_count(const group_index_view& groups) {
  return groups.group_count == 0 ? 0 : groups.offsets[static_cast<std::size_t>(groups.group_count)];
}

/// Index = slot of the query: every slot_count-th member of the groups.
template <class Descriptor, class Camera>
struct look_up_query_groups {
  search_view<Descriptor, Camera> search;
  group_lookup lookup;

  TURBOMAP_HD void operator()(int slot) const {
    const auto& groups = search.query().groups;
    const std::uint32_t end = grouped_count(groups);
    for (auto p = static_cast<std::uint32_t>(slot); p < end; p += static_cast<std::uint32_t>(search.slot_count)) {
      const auto keypoint = static_cast<std::int32_t>(groups.keypoints[p]);
      if (holds_no_point(keypoint)) lookup.query[keypoint] = groups.ids[group_at(groups, p)];
    }
  }

 private:
  TURBOMAP_HD bool holds_no_point(std::int32_t keypoint) const {
    const int slot = first_where(0, search.slot_count, [&](int i) { return search.queries[i] >= keypoint; });
    return slot < search.slot_count && search.queries[slot] == keypoint;
  }
};

/// Index = keypoint of any neighbour, as a position in the members of its groups.
template <class Descriptor, class Camera>
struct look_up_neighbour_groups {
  search_view<Descriptor, Camera> search;
  group_lookup lookup;

  TURBOMAP_HD void operator()(int i) const {
    const int n = first_where(1, search.neighbour_count, [&](int k) { return search.has_point_offset[k] > i; }) - 1;
    const auto& groups = search.neighbour(n).groups;
    const auto p = static_cast<std::uint32_t>(i - search.has_point_offset[n]);
    if (p < grouped_count(groups))
      lookup.neighbour[static_cast<std::uint32_t>(search.has_point_offset[n]) + groups.keypoints[p]] =
          groups.ids[group_at(groups, p)];
  }
};

}  // namespace detail

/// Looks up the group of each query slot, by one thread each.
template <class Derived, class Descriptor, class Camera>
void launch_look_up_query_groups(const thrust::execution_policy<Derived>& policy,
                                 const search_view<Descriptor, Camera>& search, const group_lookup& lookup) {
  for_each_index(derived(policy), search.slot_count, detail::look_up_query_groups<Descriptor, Camera>{search, lookup});
}
/// Looks up the group of each keypoint of the neighbours, by one thread each.
template <class Derived, class Descriptor, class Camera>
void launch_look_up_neighbour_groups(const thrust::execution_policy<Derived>& policy,
                                     const search_view<Descriptor, Camera>& search, const group_lookup& lookup,
                                     int keypoints) {
  for_each_index(derived(policy), keypoints, detail::look_up_neighbour_groups<Descriptor, Camera>{search, lookup});
}

/// Fills a lookup in the scratch of this call. O(keypoints log groups).
template <class Descriptor, class Camera, class Policy>
group_lookup look_up_groups(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches) {
  static_assert(keypoint::no_group == 0xFFFFFFFFu, "filled byte by byte");
  const auto& search = matches.view();
  const std::size_t query = matches.queries().empty() ? 0 : static_cast<std::size_t>(matches.queries().back()) + 1;
  const std::size_t neighbour = matches.neighbour_keypoint_count();
  const group_lookup lookup{ctx.template scratch<std::uint32_t>(query), ctx.template scratch<std::uint32_t>(neighbour),
                            static_cast<std::int32_t>(query)};
  fill_bytes(ctx.policy(), lookup.query, 0xFF, query * sizeof(std::uint32_t));
  fill_bytes(ctx.policy(), lookup.neighbour, 0xFF, neighbour * sizeof(std::uint32_t));
  launch_look_up_query_groups(ctx.policy(), search, lookup);
  launch_look_up_neighbour_groups(ctx.policy(), search, lookup, static_cast<int>(neighbour));
  return lookup;
}

TURBOMAP_END_NAMESPACE
