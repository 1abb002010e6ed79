// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_reduce_blocks() under a CUDA policy: one thread block per block of the reduced matrix. Its threads take the entries
/// of the block's list in turn and keep sums of their own, which are then added up in a fixed order: over the lanes of a warp,
/// then over the warps. The columns of an entry come by way of shared memory.

#include <cuda_pipeline.h>

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../reduced_system.hpp"
#include "staged_columns.cuh"
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

/// Two slots per lane of a block. Where there is no room for that, half of the lanes take turns with the other half.
template <class A, int V>
struct block_columns {
  static constexpr int warps = reduce_blocks_tuning::warps;
  static constexpr int lanes = 2 * warps * warp_size * 3 * V * sizeof(A) <= 40 * 1024 ? warp_size : warp_size / 2;
  staged_columns<A, V, lanes> of_warp[warps][2];
};

/// A diagonal block and its right hand side.
template <class A, int V, int D>
__device__ inline void reduce_diagonal_block(const schur_view<A>& s, const reduced_layout& out, const damping& damping,
                                             int f, block_columns<A, V>& columns) {
  constexpr int triangle = V * (V + 1) / 2, size = triangle + V, threads = warp_size * reduce_blocks_tuning::warps;
  constexpr int lanes = block_columns<A, V>::lanes;
  __shared__ double of_warp[reduce_blocks_tuning::warps][size];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size;
  auto& staged = columns.of_warp[thread / warp_size];
  A sum[size] = {};
  const int end = s.frame_slot[f + 1];
  int first = s.frame_slot[f] + thread - lane, buffer = 0;  // of this warp
  int next = first + lane < end ? s.slot_list[first + lane] : 0;
  staged[buffer].copy(s.eliminated, next, 0, end - first);
  __pipeline_commit();
  for (; first < end; first += threads) {
    const int slot = next, after = first + threads;
    const eliminated_landmark& e = s.landmark[s.slot_landmark[slot]];
    const A c[3] = {static_cast<A>(e.c[0]), static_cast<A>(e.c[1]), static_cast<A>(e.c[2])};
    next = after + lane < end ? s.slot_list[after + lane] : 0;
    for (int from = 0; from < warp_size; from += lanes, buffer ^= 1) {
      const bool more = from + lanes < warp_size;
      staged[buffer ^ 1].copy(s.eliminated, more ? slot : next, more ? from + lanes : 0, end - (more ? first : after));
      __pipeline_commit();
      __pipeline_wait_prior(1);
      __syncwarp();
      if (lane >= from && lane < from + lanes && first + lane < end) {
#pragma unroll
        for (int m = 0; m < 3; ++m) {
          A z[V];
          staged[buffer].load(lane - from, m, z);
#pragma unroll
          for (int i = 0; i < V; ++i) {
#pragma unroll
            for (int j = 0; j <= i; ++j) sum[i * (i + 1) / 2 + j] += z[i] * z[j];
            sum[triangle + i] += z[i] * c[m];
          }
        }
      }
      __syncwarp();
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
__device__ inline void reduce_other_block(const schur_view<A>& s, const reduced_layout& out, int b,
                                          block_columns<A, V>& columns) {
  constexpr int threads = warp_size * reduce_blocks_tuning::warps, lanes = block_columns<A, V>::lanes;
  __shared__ double of_warp[reduce_blocks_tuning::warps][V * V];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size;
  auto& staged = columns.of_warp[thread / warp_size];
  A sum[V * V] = {};
  const int end = s.block_pair[b + 1];
  int first = s.block_pair[b] + thread - lane;  // of this warp
  slot_pair next = first + lane < end ? s.pairs[first + lane] : slot_pair{};
  for (; first < end; first += threads) {
    const slot_pair pair = next;
    const int after = first + threads + lane;
    for (int from = 0; from < warp_size; from += lanes) {
      staged[0].copy(s.eliminated, pair.first, from, end - first);
      staged[1].copy(s.eliminated, pair.second, from, end - first);
      __pipeline_commit();
      if (from == 0 && after < end) next = s.pairs[after];  // while this one's columns come
      __pipeline_wait_prior(0);
      __syncwarp();
      if (lane >= from && lane < from + lanes && first + lane < end) {
#pragma unroll
        for (int m = 0; m < 3; ++m) {
          A x[V], y[V];
          staged[0].load(lane - from, m, x), staged[1].load(lane - from, m, y);
#pragma unroll
          for (int i = 0; i < V * V; ++i) sum[i] += x[i / V] * y[i % V];
        }
      }
      __syncwarp();
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
__global__ void __launch_bounds__(warp_size* reduce_blocks_tuning::warps, reduce_blocks_tuning::at_once<A, V>)
    reduce_blocks_kernel(schur_view<A> s, reduced_layout out, damping damping) {
  begin_early();
  if (s.lambda != nullptr) damping.lambda = *s.lambda;
  if (isnan(damping.lambda)) return;
  __shared__ detail::block_columns<A, V> columns;
  const int task = static_cast<int>(blockIdx.x);  // diagonal blocks have the longest lists: they start first
  if (task < s.free_frames)
    detail::reduce_diagonal_block<A, V, D>(s, out, damping, task, columns);
  else
    detail::reduce_other_block<A, V, D>(s, out, task - s.free_frames, columns);
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
