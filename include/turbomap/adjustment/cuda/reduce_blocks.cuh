// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_reduce_blocks() under a CUDA policy: one thread block per block of the reduced matrix. Its threads take the entries
/// of the block's list in turn and keep sums of their own, which are then added up in a fixed order: over the lanes of a warp,
/// then over the warps.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../reduced_system.hpp"
#include "load_numbers.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Adds up what the warps of a block have left: number i of all of them.
template <int N>
__device__ inline double sum_of_warps(const double (&of_warp)[reduce_blocks_tuning::warps][N], int i) {
  double sum = 0;
  for (int w = 0; w < reduce_blocks_tuning::warps; ++w) sum += of_warp[w][i];
  return sum;
}

/// A diagonal block and its right hand side.
template <class A, int V, int D>
__device__ inline void reduce_diagonal_block(const schur_view<A>& s, const reduced_layout& out, const damping& damping,
                                             int f) {
  constexpr int triangle = V * (V + 1) / 2, size = triangle + V, threads = warp_size * reduce_blocks_tuning::warps;
  __shared__ double of_warp[reduce_blocks_tuning::warps][size];
  const int thread = static_cast<int>(threadIdx.x);
  A sum[size] = {};
  const int end = s.frame_slot[f + 1];
  int k = s.frame_slot[f] + thread;
  int next = k < end ? s.slot_list[k] : 0, next_landmark = k < end ? s.slot_landmark[next] : 0;
  while (k < end) {
    const int slot = next;
    const eliminated_landmark& e = s.landmark[next_landmark];
    k += threads;
    if (k < end) next = s.slot_list[k], next_landmark = s.slot_landmark[next];  // while this one's columns come
    A z[3 * V];
    load_numbers(s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V, z);
#pragma unroll
    for (int m = 0; m < 3; ++m) {
      const A c = static_cast<A>(e.c[m]);
#pragma unroll
      for (int i = 0; i < V; ++i) {
#pragma unroll
        for (int j = 0; j <= i; ++j) sum[i * (i + 1) / 2 + j] += z[m * V + i] * z[m * V + j];
        sum[triangle + i] += z[m * V + i] * c;
      }
    }
  }
  sum_warp(sum, of_warp[thread / warp_size]);
  __syncthreads();
  double* S = out.block(0, f, f, s.free_frames, D);
  const int stride = out.dense ? out.stride : D;
  for (int i = thread; i < D * D; i += threads) {
    const int r = i / D, c = i % D, at = r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r;
    double x = s.H[static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle + at];
    if (r == c) x += damping(x);
    if (r < V && c < V) x -= sum_of_warps(of_warp, at);
    S[static_cast<std::ptrdiff_t>(r) * stride + c] = x;
  }
  for (int r = thread; r < D; r += threads)
    out.rhs[f * D + r] =
        s.b[static_cast<std::ptrdiff_t>(f) * D + r] - (r < V ? sum_of_warps(of_warp, triangle + r) : 0);
}

/// The block of two frames.
template <class A, int V, int D>
__device__ inline void reduce_other_block(const schur_view<A>& s, const reduced_layout& out, int b) {
  constexpr int threads = warp_size * reduce_blocks_tuning::warps;
  __shared__ double of_warp[reduce_blocks_tuning::warps][V * V];
  const int thread = static_cast<int>(threadIdx.x);
  A sum[V * V] = {};
  const int end = s.block_pair[b + 1];
  int k = s.block_pair[b] + thread;
  slot_pair next = k < end ? s.pairs[k] : slot_pair{};
  while (k < end) {
    const slot_pair pair = next;
    k += threads;
    if (k < end) next = s.pairs[k];  // while this one's columns come
    A first[3 * V], second[3 * V];
    load_numbers(s.eliminated + static_cast<std::ptrdiff_t>(pair.first) * 3 * V, first);
    load_numbers(s.eliminated + static_cast<std::ptrdiff_t>(pair.second) * 3 * V, second);
#pragma unroll
    for (int m = 0; m < 3; ++m) {
#pragma unroll
      for (int i = 0; i < V * V; ++i) sum[i] += first[m * V + i / V] * second[m * V + i % V];
    }
  }
  sum_warp(sum, of_warp[thread / warp_size]);
  __syncthreads();
  double* S = out.block(b, s.block_row[b], s.block_column[b], s.free_frames, D);
  const int stride = out.dense ? out.stride : D;
  for (int i = thread; i < D * D; i += threads) {
    const int r = i / D, c = i % D;
    double x = r < V && c < V ? -sum_of_warps(of_warp, r * V + c) : 0;
    for (int k = s.block_factor[b]; k < s.block_factor[b + 1]; ++k) {
      const int code = s.factor_list[k];
      const double* square = s.sums.factor_square + static_cast<std::ptrdiff_t>(code / 2) * D * D;
      x += code % 2 == 0 ? square[i] : square[c * D + r];
    }
    S[static_cast<std::ptrdiff_t>(r) * stride + c] = x;
  }
}

}  // namespace detail

template <class A, int V, int D>
__global__ void __launch_bounds__(warp_size* reduce_blocks_tuning::warps)
    reduce_blocks_kernel(schur_view<A> s, reduced_layout out, damping damping) {
  begin_early();
  if (s.lambda != nullptr) damping.lambda = *s.lambda;
  if (isnan(damping.lambda)) return;
  const int task = static_cast<int>(blockIdx.x);  // diagonal blocks have the longest lists: they start first
  if (task < s.free_frames)
    detail::reduce_diagonal_block<A, V, D>(s, out, damping, task);
  else
    detail::reduce_other_block<A, V, D>(s, out, task - s.free_frames);
}

template <int V, int D, class Derived, class A>
void launch_reduce_blocks(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                          const reduced_layout& out, const damping& damping) {
  if constexpr (V > reduce_blocks_tuning::most_unknowns)
    launch_reduce_blocks<V, D>(static_cast<const thrust::execution_policy<Derived>&>(policy), s, out, damping);
  else
    launch_early(policy, "launch of reduce_blocks", 0, reduce_blocks_kernel<A, V, D>, s.free_frames + s.blocks,
                 warp_size * reduce_blocks_tuning::warps, s, out, damping);
}

TURBOMAP_END_NAMESPACE
