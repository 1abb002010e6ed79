// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_sum_reprojection_cost() under a CUDA policy: a lane per observation instead of a thread per chunk.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../reprojection_cost.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Camera, class Kernel, class G>
__global__ void __launch_bounds__(linearise_tuning::threads)
    sum_reprojection_cost_kernel(cost_of_reprojections<Camera, Kernel, G, 1> work) {
  begin_early();
  constexpr int lanes = linearise_tuning::lanes;
  const int thread = static_cast<int>(blockIdx.x) * linearise_tuning::threads + static_cast<int>(threadIdx.x);
  const int chunk = thread / lanes, lane = thread % lanes;
  typename cost_of_reprojections<Camera, Kernel, G, 1>::part p;
  if (chunk < work.group.chunk_count) work.add(work.group.chunks[chunk], lane, lanes, p);
  const G total = sum_lanes<lanes>(p.total.v[0]), missing = sum_lanes<lanes>(p.missing.v[0]);
  if (chunk < work.group.chunk_count && lane == 0) work.finish(chunk, total, missing);
}

template <class G, class Derived, class Camera, class Kernel>
void launch_sum_reprojection_cost(const thrust::cuda_cub::execution_policy<Derived>& policy,
                                  const reprojection_view<Camera, Kernel>& group, const isometry<double>* T_bw,
                                  const double* landmarks, const cost_sums& sums) {
  constexpr int chunks = linearise_tuning::threads / linearise_tuning::lanes;
  launch_early(policy, "launch of sum_reprojection_cost", 0, sum_reprojection_cost_kernel<Camera, Kernel, G>,
               (group.chunk_count + chunks - 1) / chunks, linearise_tuning::threads,
               cost_of_reprojections<Camera, Kernel, G, 1>{group, T_bw, landmarks, sums});
}

TURBOMAP_END_NAMESPACE
