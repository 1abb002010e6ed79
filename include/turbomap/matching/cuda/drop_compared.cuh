// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Filters that compare under a CUDA policy: with all keypoints, which a device does faster than it sorts them.

#include "../../config.hpp"
#include "../../context.hpp"
#include "../apply_filter.hpp"
#include "../ordered_tables.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <sorted_side, class Derived, class Descriptor, class Camera, class Memory, class Filter>
void launch_drop_compared(const thrust::cuda_cub::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search, scratch_arena<Memory>&, const Filter& filter) {
  launch_drop_matches(policy, search, filter);
}

TURBOMAP_END_NAMESPACE
