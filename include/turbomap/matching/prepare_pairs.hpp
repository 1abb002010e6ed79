// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The geometry of every pair of a query camera and a neighbour camera, computed once per search.

#include "../config.hpp"
#include "../context.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

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

/// The geometry of every pair, by one thread each.
template <class Derived, class Descriptor, class Camera>
void launch_prepare_pairs(const thrust::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.neighbour_count * search.query_cameras * search.neighbour_cameras,
                 prepare_pair<Descriptor, Camera>{search});
}

TURBOMAP_END_NAMESPACE
