// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Point creation under a CUDA policy. The plan fetches the points of all results from the device in one copy, so none may be
/// left unwritten.

#include <cstddef>

#include "../../config.hpp"
#include "../../context.hpp"
#include "../create_point.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Derived, class Descriptor, class Camera>
void launch_create_points(const thrust::cuda_cub::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search, const creation_options& options,
                          created_point* points) {
  const int count = search.neighbour_count * search.slot_count;
  fill_bytes(derived(policy), points, 0, static_cast<std::size_t>(count) * sizeof(created_point));
  for_each_index(derived(policy), count, create_point<Descriptor, Camera>{search, options, points});
}

TURBOMAP_END_NAMESPACE
