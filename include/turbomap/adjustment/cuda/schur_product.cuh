// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The product with the reduced matrix under a CUDA policy: a few lanes per landmark and a block per frame share the slots, and
/// add their sums up in a fixed order.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../schur_product.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// \param ended  nothing is done where it is not 0; null: it is
template <class A, int V, int D>
__global__ void __launch_bounds__(landmark_tuning::threads)
    gather_landmarks_kernel(gather_landmarks<A, V, D> work, const std::int32_t* ended) {
  begin_early();
  if (ended != nullptr && *ended != 0) return;
  constexpr int lanes = landmark_tuning::lanes;
  const int thread = static_cast<int>(threadIdx.x), lane = thread % lanes;
  const int l = static_cast<int>(blockIdx.x) * landmark_tuning::landmarks + thread / lanes;
  const bool there = l < work.s.landmarks;
  double sum[3] = {};
  if (there)
    for (int slot = work.s.landmark_slot[l] + lane; slot < work.s.landmark_slot[l + 1]; slot += lanes)
      work.add(slot, sum);
  for (double& x : sum) x = sum_lanes<lanes>(x);
  if (there && lane < 3)
    work.y[static_cast<std::ptrdiff_t>(l) * 3 + lane] = lane == 0 ? sum[0] : lane == 1 ? sum[1] : sum[2];
}

/// \param product  [free frame] parts of p q; may be null   \param ended  as above
template <class A, int V, int D>
__global__ void __launch_bounds__(warp_size* schur_product_tuning::warps)
    multiply_frames_kernel(multiply_frames<A, V, D> work, double* product, const std::int32_t* ended) {
  begin_early();
  if (ended != nullptr && *ended != 0) return;
  constexpr int warps = schur_product_tuning::warps, threads = warps * warp_size;
  __shared__ double of_warp[warps][V], of_row[D];
  const int thread = static_cast<int>(threadIdx.x), f = static_cast<int>(blockIdx.x);
  double sum[V] = {};
  for (int k = work.s.frame_slot[f] + thread; k < work.s.frame_slot[f + 1]; k += threads)
    work.subtract(work.s.slot_list[k], sum);
  sum_warp(sum, of_warp[thread / warp_size]);
  __syncthreads();
  for (int r = thread; r < D; r += threads) {
    double total = work.of_frames(f, r);
    for (int w = 0; w < warps && r < V; ++w) total += of_warp[w][r];
    work.q[static_cast<std::ptrdiff_t>(f) * D + r] = total;
    of_row[r] = total * work.p[static_cast<std::ptrdiff_t>(f) * D + r];
  }
  if (product == nullptr) return;
  __syncthreads();
  if (thread != 0) return;
  double of_frame = 0;
  for (int r = 0; r < D; ++r) of_frame += of_row[r];
  product[f] = of_frame;
}

template <int V, int D, class Derived, class A>
void launch_gather_landmarks(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                             const double* p, double* y) {
  constexpr int landmarks = landmark_tuning::landmarks;
  launch_kernel(policy, "launch of gather_landmarks", gather_landmarks_kernel<A, V, D>,
                (s.landmarks + landmarks - 1) / landmarks, landmark_tuning::threads, gather_landmarks<A, V, D>{s, p, y},
                nullptr);
}

template <int V, int D, class Derived, class A>
void launch_multiply_frames(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                            const double* p, const double* y, const damping& damping, double* q) {
  launch_kernel(policy, "launch of multiply_frames", multiply_frames_kernel<A, V, D>, s.free_frames,
                warp_size * schur_product_tuning::warps, multiply_frames<A, V, D>{s, p, y, damping, q}, nullptr,
                nullptr);
}

TURBOMAP_END_NAMESPACE
