// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_sum_frames() under a CUDA policy: one block per frame instead of one thread. Each warp sums every warps-th partial
/// sum of the frame, a lane the same elements of all of them; then the sums of the warps are added up, always in the same
/// order, so the result has the same bits each time.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/tuning.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../schur_view.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Frame f, by a block.
template <class A, int V, int D>
__device__ inline void sum_frame(const schur_view<A>& s, int f) {
  using chunk = landmark_block<V>;
  using whole = frame_block<D>;
  constexpr int warps = sum_frames_tuning::warps, per_lane = (whole::partial + 31) / 32;
  __shared__ double of_warp[warps][whole::partial];
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int warp = static_cast<int>(threadIdx.x) / 32;

  double total[per_lane] = {};
  const int end = s.frame_partial[f + 1];
  for (int first = s.frame_partial[f] + warp; first < end; first += warps * warp_size) {
    const int own = first + warps * lane < end ? s.partial_list[first + warps * lane] : 0;
    const int count = (end - first + warps - 1) / warps;
#pragma unroll 8
    for (int k = 0; k < (count < warp_size ? count : warp_size); ++k) {
      const double* p =
          s.sums.chunk_partial + static_cast<std::ptrdiff_t>(__shfl_sync(whole_warp, own, k)) * chunk::partial;
      for (int m = 0; m < per_lane; ++m) {  // the V unknowns that landmarks depend on are the first of D
        const int i = lane + 32 * m;
        if (i < chunk::triangle)
          total[m] += p[i];
        else if (i >= whole::triangle && i < whole::triangle + V)
          total[m] += p[chunk::triangle + i - whole::triangle];
      }
    }
  }
  for (int k = s.frame_factor[f] + warp; k < s.frame_factor[f + 1]; k += warps) {
    const double* p = s.sums.factor_partial + static_cast<std::ptrdiff_t>(s.frame_factor_list[k]) * whole::partial;
    for (int m = 0; m < per_lane; ++m)
      if (lane + 32 * m < whole::partial) total[m] += p[lane + 32 * m];
  }
  for (int m = 0; m < per_lane; ++m)
    if (lane + 32 * m < whole::partial) of_warp[warp][lane + 32 * m] = total[m];
  __syncthreads();

  for (int i = static_cast<int>(threadIdx.x); i < whole::partial; i += 32 * warps) {
    double sum = 0;
    for (int w = 0; w < warps; ++w) sum += of_warp[w][i];
    if (i < whole::triangle)
      s.H[static_cast<std::ptrdiff_t>(f) * whole::triangle + i] = sum;
    else
      s.b[static_cast<std::ptrdiff_t>(f) * D + i - whole::triangle] = sum;
  }
}

template <class A, int V, int D>
__global__ void __launch_bounds__(warp_size* sum_frames_tuning::warps) sum_frames_kernel(schur_view<A> s) {
  begin_early();
  sum_frame<A, V, D>(s, static_cast<int>(blockIdx.x));
}

template <int V, int D, class Derived, class A>
void launch_sum_frames(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s) {
  if constexpr (sizeof(double) * sum_frames_tuning::warps * frame_block<D>::partial > shared_memory_bytes)
    launch_sum_frames<V, D>(static_cast<const thrust::execution_policy<Derived>&>(policy), s);
  else
    launch_early(policy, "launch of sum_frames", 0, sum_frames_kernel<A, V, D>, s.free_frames,
                 warp_size * sum_frames_tuning::warps, s);
}

TURBOMAP_END_NAMESPACE
