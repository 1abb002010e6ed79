// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The filter of claims: a neighbour keypoint is matched once. A search lets several query keypoints claim one keypoint; it
/// can show one point of the scene only, so the most similar claim stays.

#include <cstdint>

#include "../atomic.hpp"
#include "../claim.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "apply_filter.hpp"

namespace turbomap {

/// Keeps, of the matches that claim one neighbour keypoint, the one of least (distance, query keypoint).
struct one_to_one {};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The best claim of every neighbour keypoint: the slot is who claims.
struct keep_winner {
  std::uint64_t* claims;  ///< at has_point_offset[n] + keypoint

  template <class Descriptor, class Camera>
  TURBOMAP_HD static std::uint64_t claim(const search_view<Descriptor, Camera>& search, int i) {
    return make_claim(search.distance[i], static_cast<std::uint32_t>(i % search.slot_count));
  }
  template <class Descriptor, class Camera>
  TURBOMAP_HD std::uint64_t* cell(const search_view<Descriptor, Camera>& search, int i) const {
    return claims + search.has_point_offset[i / search.slot_count] + search.match[i];
  }
  template <class Descriptor, class Camera>
  TURBOMAP_HD bool keep(const search_view<Descriptor, Camera>& search, int i) const {
    return *cell(search, i) == claim(search, i);
  }
};
template <class Descriptor, class Camera>
struct make_claims {
  search_view<Descriptor, Camera> search;
  keep_winner winner;

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] != no_match) atomic_min(winner.cell(search, i), winner.claim(search, i));
  }
};

}  // namespace detail

/// Every match claims its neighbour keypoint.
template <class Derived, class Descriptor, class Camera>
void launch_make_claims(const thrust::execution_policy<Derived>& policy, const search_view<Descriptor, Camera>& search,
                        const detail::keep_winner& winner) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 detail::make_claims<Descriptor, Camera>{search, winner});
}

/// Keeps one match per neighbour keypoint. O(results of the search).
template <class Descriptor, class Camera, class Policy>
void apply_filter(context<Policy>& ctx, correspondences<Descriptor, Camera, Policy>& matches, const one_to_one&) {
  const std::size_t keypoints = matches.neighbour_keypoint_count();
  ctx.begin_call();
  detail::keep_winner winner{ctx.template scratch<std::uint64_t>(keypoints)};
  fill_bytes(ctx.policy(), winner.claims, 0xFF, keypoints * sizeof(std::uint64_t));
  launch_make_claims(ctx.policy(), matches.view(), winner);
  apply_filter(ctx, matches, winner);
}

TURBOMAP_END_NAMESPACE
