// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_linearise_reprojections() under a CUDA policy: a lane per observation instead of a thread per chunk. The lanes of a
/// chunk add up what the frame gets, in a fixed order.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../linearise_reprojections.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Camera, class Kernel, class G, class A, int V>
__global__ void __launch_bounds__(linearise_tuning::threads)
    linearise_reprojections_kernel(linearise_reprojections<Camera, Kernel, G, A, 1, V> work) {
  begin_early();
  using P = typename linearise_reprojections<Camera, Kernel, G, A, 1, V>::P;
  using block = landmark_block<V>;
  constexpr int lanes = linearise_tuning::lanes, triangle = 21, size = triangle + 6;
  const auto& group = work.group;
  const int thread = static_cast<int>(blockIdx.x) * linearise_tuning::threads + static_cast<int>(threadIdx.x);
  const int chunk = thread / lanes, lane = thread % lanes;
  const bool is_chunk = chunk < group.chunk_count;
  const observation_chunk c = group.chunks[is_chunk ? chunk : 0];
  P H[triangle], b[6];
  reprojection_cost_part<G, 1> cost;
  for (int i = 0; i < triangle; ++i) H[i] = P(A(0));
  for (int i = 0; i < 6; ++i) b[i] = P(A(0));
  if (is_chunk) {
    const isometry<double>& T = work.T_bw[c.frame];
    const auto& camera = group.cameras[c.kind / 2];
    P R[9];
    for (int i = 0; i < 9; ++i) R[i] = P(static_cast<A>(T.R.m[i]));
    for (int i = lane; i < c.count; i += lanes)
      if (c.kind % 2 == 1)
        work.template observe<true>(c, c.begin + i, 1, group.stereo, camera, T, R, H, b, cost);
      else
        work.template observe<false>(c, c.begin + i, 1, group.mono, camera, T, R, H, b, cost);
  }
  if (work.costs.cost != nullptr) {
    const G total = sum_lanes<lanes>(cost.total.v[0]), missing = sum_lanes<lanes>(cost.missing.v[0]);
    if (is_chunk && lane == 0) write_cost(group, chunk, total, missing, work.costs);
  }
  A x[size], mine[sums_per_lane<lanes, size>];
  for (int i = 0; i < size; ++i)
    x[i] = i < triangle ? H[i < triangle ? i : 0].v[0] : b[i < triangle ? 0 : i - triangle].v[0];
  sum_numbers<lanes>(x, mine);
  if (!is_chunk || c.free < 0) return;
  double* out = work.sums.chunk_partial + static_cast<std::ptrdiff_t>(group.first_chunk + chunk) * block::partial;
  for (int i = lane; i < block::partial; i += lanes)  // unknowns that a reprojection does not depend on
    if ((i >= triangle && i < block::triangle) || i >= block::triangle + 6) out[i] = 0;
  for (int i = 0; i < sums_per_lane<lanes, size>; ++i) {
    const int at = lane * sums_per_lane<lanes, size> + i;
    if (at < size) out[at < triangle ? at : block::triangle + at - triangle] = static_cast<double>(mine[i]);
  }
}

template <class G, int V, class Derived, class Camera, class Kernel, class A>
void launch_linearise_reprojections(const thrust::cuda_cub::execution_policy<Derived>& policy,
                                    const reprojection_view<Camera, Kernel>& group, const isometry<double>* T_bw,
                                    const double* landmarks, const factor_sums<A>& sums, const cost_sums& costs) {
  constexpr int chunks = linearise_tuning::threads / linearise_tuning::lanes;
  launch_early(policy, "launch of linearise_reprojections", 0, linearise_reprojections_kernel<Camera, Kernel, G, A, V>,
               (group.chunk_count + chunks - 1) / chunks, linearise_tuning::threads,
               linearise_reprojections<Camera, Kernel, G, A, 1, V>{group, T_bw, landmarks, sums, costs});
}

TURBOMAP_END_NAMESPACE
