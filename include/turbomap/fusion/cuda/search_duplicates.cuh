// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The duplicate search under a CUDA policy: one thread per point and camera.

#include "../../config.hpp"
#include "../../context.hpp"
#include "../search_duplicates.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Derived, class Descriptor, class Camera>
void launch_search_duplicates(const thrust::cuda_cub::execution_policy<Derived>& policy,
                              const duplicate_view<Descriptor, Camera>& search) {
  for_each_index(derived(policy), search.request_count * search.points.count,
                 duplicate_search<Descriptor, Camera, 1>{search});
}

TURBOMAP_END_NAMESPACE
