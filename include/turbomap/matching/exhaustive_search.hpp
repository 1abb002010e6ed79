// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search that compares every query keypoint with every keypoint of every neighbour, under any policy. It defines the
/// answer; the ordered search finds the same one faster on the host.

#include <type_traits>

#include "../config.hpp"
#include "../context.hpp"
#include "../memory.hpp"
#include "candidate_scan.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index i + first = neighbour * slot_count + slot. Compares with every keypoint without a map point.
template <class Descriptor, class Camera>
struct exhaustive_search {
  static constexpr int part_size = 256;  ///< results per launch of a search that can be stopped between launches

  search_view<Descriptor, Camera> search;  ///< what is read and written
  int first = 0;                           ///< added to every index

  /// Searches for one result.
  TURBOMAP_HD void operator()(int i) const {
    i += first;
    const int n = i / search.slot_count, keypoint = search.queries[i % search.slot_count];
    const auto& neighbour = search.neighbour(n);
    const auto* descriptor = search.query().descriptor_of(keypoint);
    candidate_scan<Descriptor, Camera> scan(search, n, keypoint);
    for (int k = search.candidate_begin[n]; k < search.candidate_end[n]; ++k) {
      const std::int32_t c = search.candidates[k];
      const auto d = Descriptor::distance(descriptor, neighbour.descriptor_of(c));
      if (d <= scan.best_distance()) scan.consider(c, d);
    }
    search.match[i] = scan.best();
    search.distance[i] = scan.best_distance();
  }
};

/// \return false: stopped before the end; what was not reached has no meaning
template <class Derived, class Descriptor, class Camera>
bool launch_search_exhaustive(const thrust::execution_policy<Derived>& policy,
                              const search_view<Descriptor, Camera>& search) {
  using body = exhaustive_search<Descriptor, Camera>;
  const int count = search.neighbour_count * search.slot_count;
  // What may be stopped is launched in parts. Not on a device, which is done before anybody could want to stop it.
  constexpr bool on_host = std::is_same_v<memory_of_t<Derived>, host_memory>;
  const bool watched = on_host && search.options.stop;
  const int part = watched ? body::part_size : count;
  for (int first = 0; first < count; first += part) {
    if (watched && search.options.stopped()) return false;
    for_each_index(derived(policy), count - first < part ? count - first : part, body{search, first});
  }
  return true;
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/search_exhaustive.cuh"
#endif
