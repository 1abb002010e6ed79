// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The epipolar-ordered search under a CUDA policy: a device compares all candidates faster than it sorts them, with the same
/// answer.

#include "../../config.hpp"
#include "../../context.hpp"
#include "../exhaustive_search.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Derived, class Descriptor, class Camera, class Memory>
bool launch_search_ordered(const thrust::cuda_cub::execution_policy<Derived>& policy,
                           const search_view<Descriptor, Camera>& search, scratch_arena<Memory>&) {
  return launch_search_exhaustive(policy, search);
}

TURBOMAP_END_NAMESPACE
