// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The filter of one-sided matches. The best candidate of a query keypoint may itself resemble another query keypoint more:
/// a match stays only if each of the two is the best for the other (cross-check).

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "apply_filter.hpp"
#include "candidate_scan.hpp"
#include "filter_windows.hpp"
#include "find_group.hpp"
#include "group_lookup.hpp"

namespace turbomap {

/// Keeps a match if no other query keypoint that passes the epipolar test is nearer to the candidate (equal: the lower index).
struct mutual_best {};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One match against other query keypoints.
template <class Descriptor, class Camera>
struct mutual_comparison {
  using distance_type = typename Descriptor::distance_type;

  const search_view<Descriptor, Camera>& search;
  int n;
  std::int32_t query, match;
  distance_type distance;

  TURBOMAP_HD mutual_comparison(const search_view<Descriptor, Camera>& s, int i)
      : search(s),
        n(i / s.slot_count),
        query(s.queries[i % s.slot_count]),
        match(s.match[i]),
        distance(s.distance[i]) {}

  /// Whether a query keypoint suits the candidate better.
  TURBOMAP_HD bool nearer(std::int32_t q) const {
    const auto other = Descriptor::distance(search.query().descriptor_of(q), search.neighbour(n).descriptor_of(match));
    if (q == query || !(other < distance || (other == distance && q < query))) return false;
    return candidate_scan<Descriptor, Camera>(search, n, q).consistent(match);
  }
};

/// Against all query keypoints, or those near its epipolar curve.
struct keep_mutual {
  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    const mutual_comparison<Descriptor, Camera> comparison(search, i);
    for (int k = 0; k < search.slot_count; ++k)
      if (comparison.nearer(search.queries[k])) return false;
    return true;
  }
  template <class Descriptor, class Camera, class Windows>
  bool keep_among(const search_view<Descriptor, Camera>& search, int i, const Windows& windows) const {
    const mutual_comparison<Descriptor, Camera> comparison(search, i);
    return !windows.any(comparison.n, comparison.match, [&comparison](std::int32_t q) { return comparison.nearer(q); });
  }
};
/// Against those of the candidate's group.
struct keep_mutual_in_group {
  group_lookup lookup;

  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    const mutual_comparison<Descriptor, Camera> comparison(search, i);
    const std::uint32_t id = lookup.neighbour[search.has_point_offset[comparison.n] + comparison.match];
    return !any_of_group(search.query().groups, id, [&](std::int32_t q) {
      return q < lookup.query_size && lookup.query[q] == id && comparison.nearer(q);
    });
  }
};

}  // namespace detail

/// Cost: O(matches x query keypoints), after an ordered search on the host a few percent of that, O(matches x group)
/// after a grouped one.
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const mutual_best&) {
  ctx.begin_call();
  if (matches.view().options.candidate_set == candidates::grouped)
    apply_filter(ctx, matches, detail::keep_mutual_in_group{look_up_groups(ctx, matches)});
  else
    launch_drop_compared<sorted_side::queries>(ctx.policy(), matches.view(), ctx.scratch(), detail::keep_mutual{});
}

TURBOMAP_END_NAMESPACE
