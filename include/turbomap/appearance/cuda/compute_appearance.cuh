// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The appearance of points under a CUDA policy: one thread per point, without a table of distances, which would be in device
/// memory.

#include "../../config.hpp"
#include "../../context.hpp"
#include "../compute_appearance.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Derived, class Descriptor, class Camera>
void launch_compute_appearance(const thrust::cuda_cub::execution_policy<Derived>& policy,
                               const detail::appearance_inputs<Descriptor, Camera>& in, int count,
                               point_appearance* points, typename Descriptor::element* descriptors) {
  for_each_index(derived(policy), count,
                 detail::compute_appearance<Descriptor, Camera, medoid_in_registers>{in, points, descriptors});
}

TURBOMAP_END_NAMESPACE
