// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a search works out once, where the policy computes: which keypoints of each neighbour are candidates (those without a map
/// point), and the geometry of every pair of a query camera and a neighbour camera.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Lists the keypoints without a map point, ascending; returns their number. Writes one element more than that: a branch for each
/// keypoint would be guessed wrong half of the time. \param mapped  not 0: holds a map point; null: none does
TURBOMAP_HD inline std::int32_t list_unmapped(const std::uint8_t* mapped, std::int32_t keypoints, std::int32_t* list) {
  std::int32_t count = 0;
  for (std::int32_t i = 0; i < keypoints; ++i) {
    list[count] = i;
    count += mapped == nullptr || mapped[i] == 0;
  }
  return count;
}

}  // namespace detail

/// Index = neighbour.
template <class Descriptor, class Camera>
struct list_candidates {
  search_view<Descriptor, Camera> search;  ///< what is read and written

  /// The candidates of neighbour n.
  TURBOMAP_HD void operator()(int n) const {
    const std::int32_t begin = search.candidate_begin[n];
    search.candidate_end[n] =
        begin + detail::list_unmapped(search.has_point + search.has_point_offset[n], search.neighbour(n).keypoint_count,
                                      search.candidates + begin);
  }
};

/// Index = pair, (neighbour, query camera, neighbour camera).
template <class Descriptor, class Camera>
struct prepare_pair {
  search_view<Descriptor, Camera> search;  ///< what is read and written

  /// The geometry of pair i.
  TURBOMAP_HD void operator()(int i) const {
    const int b = i % search.neighbour_cameras, a = i / search.neighbour_cameras % search.query_cameras;
    const int n = i / (search.neighbour_cameras * search.query_cameras);
    const auto& query = search.query();
    const auto& neighbour = search.neighbour(n);
    if (b >= neighbour.camera_count) return;  // a rig with fewer cameras than another neighbour's
    // An epipole guard makes sense where depth comes from motion only: on a rig the other camera sees the point too.
    const bool guard = query.camera_count == 1 && neighbour.camera_count == 1;
    search.pair(n, a, b) =
        make_pair_geometry(query.cameras[a], search.T_cw[0], neighbour.cameras[b], search.T_cw[1 + n], guard);
  }
};

/// The candidates of every neighbour and the geometry of every pair, by one thread each.
template <class Derived, class Descriptor, class Camera>
void launch_prepare_search(const thrust::execution_policy<Derived>& policy,
                           const search_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.neighbour_count, list_candidates<Descriptor, Camera>{search});
  for_each_index(derived(policy), search.neighbour_count * search.query_cameras * search.neighbour_cameras,
                 prepare_pair<Descriptor, Camera>{search});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/prepare_search.cuh"
#endif
