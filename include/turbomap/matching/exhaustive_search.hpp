// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search that compares every query keypoint with every keypoint of every neighbour, under any policy. It defines the
/// answer; the ordered search finds the same one faster on the host.

#include "../config.hpp"
#include "../context.hpp"
#include "candidate_scan.hpp"

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

template <class Derived, class Descriptor, class Camera>
void launch_search_exhaustive(const thrust::execution_policy<Derived>& policy,
                              const search_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 exhaustive_search<Descriptor, Camera>{search});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/search_exhaustive.cuh"
#endif
