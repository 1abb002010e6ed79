// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search by projection under a CUDA policy: one thread per point and camera.

#include "../../config.hpp"
#include "../../context.hpp"
#include "../search_projections.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Derived, class Descriptor, class Camera>
void launch_search_projections(const thrust::cuda_cub::execution_policy<Derived>& policy,
                               const projection_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.request_count * search.points.count,
                 projection_search<Descriptor, Camera, 1>{search});
}

TURBOMAP_END_NAMESPACE
