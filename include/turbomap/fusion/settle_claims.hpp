// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One keypoint, one point: where several points matched a keypoint, the most similar one keeps it. Every match claims its
/// keypoint, then those whose claim was not the least are taken back.

#include <cstdint>

#include "../atomic.hpp"
#include "../claim.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = request * points + point.
template <class Descriptor, class Camera>
struct claim_keypoint {
  projection_view<Descriptor, Camera> search;  ///< what is read and written

  /// Claims the keypoint of a match.
  TURBOMAP_HD void operator()(int i) const {
    if (search.hits[i].keypoint >= 0) atomic_min(claimed(i), claim(i));
  }
  /// What a match claims with: the least distance wins, then the smallest index of a point.
  TURBOMAP_HD std::uint64_t claim(int i) const {
    return make_claim(search.hits[i].distance, static_cast<std::uint32_t>(i % search.points.count));
  }
  /// Where the keypoint's least claim is kept.
  TURBOMAP_HD std::uint64_t* claimed(int i) const {
    return search.requests[i / search.points.count].claims + search.hits[i].keypoint;
  }
};

/// The same index.
template <class Descriptor, class Camera>
struct drop_lost_claim {
  claim_keypoint<Descriptor, Camera> of;  ///< what was claimed

  /// Takes a match back whose claim was not the least.
  TURBOMAP_HD void operator()(int i) const {
    const auto& search = of.search;
    if (search.hits[i].keypoint < 0 || *of.claimed(i) == of.claim(i)) return;
    search.hits[i] = {-1, no_match_distance<Descriptor>};
    if (search.trials != nullptr) search.trials[i].outcome = projection_outcome::lost;
  }
};

/// Every match claims its keypoint.
template <class Derived, class Descriptor, class Camera>
void launch_claim_keypoints(const thrust::execution_policy<Derived>& policy,
                            const projection_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.request_count * search.points.count,
                 claim_keypoint<Descriptor, Camera>{search});
}
/// After launch_claim_keypoints(): drops the matches that lost.
template <class Derived, class Descriptor, class Camera>
void launch_drop_lost_claims(const thrust::execution_policy<Derived>& policy,
                             const projection_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.request_count * search.points.count,
                 drop_lost_claim<Descriptor, Camera>{{search}});
}

TURBOMAP_END_NAMESPACE
