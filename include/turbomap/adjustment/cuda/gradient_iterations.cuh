// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_begin_gradients(), launch_gradient_iteration() under a CUDA policy. A sum over all frames is taken by each block that needs it,
/// from the parts of the frames and in one order: that is less than a kernel of its own, and all blocks have the same bits.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../frame_vectors.hpp"
#include "../gradient_iterations.hpp"
#include "schur_product.cuh"
#include "sum_step.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The sum of n numbers, in all threads of a block. All of them take part.
template <int Threads>
__device__ inline double sum_of_block(const double* x, int n) {
  constexpr int warps = Threads / warp_size;
  __shared__ double of_warp[warps];
  const int thread = static_cast<int>(threadIdx.x);
  double sum = 0;
#pragma unroll 4
  for (int i = thread; i < n; i += Threads) sum += x[i];
  sum = sum_lanes<warp_size>(sum);
  __syncthreads();  // what an earlier sum left there has been read
  if (thread % warp_size == 0) of_warp[thread / warp_size] = sum;
  __syncthreads();
  double total = 0;
#pragma unroll
  for (int w = 0; w < warps; ++w) total += of_warp[w];
  return total;
}

}  // namespace detail

template <int Threads>
__global__ void __launch_bounds__(Threads)
    begin_gradients_kernel(gradient_vectors v, double tolerance, awaited<gradient_state>* to) {
  begin_early();
  const double factors = detail::sum_of_block<Threads>(v.product, v.free_frames);
  const double rz = detail::sum_of_block<Threads>(v.residual, v.free_frames);
  if (threadIdx.x != 0) return;
  const bool solvable = factors == v.free_frames;
  const double enough = tolerance * tolerance * rz;
  const gradient_state state{rz, enough, 0, solvable && rz > enough ? 0 : 1, solvable ? 1 : 0, 0};
  v.states[0] = state;
  detail::hand_over(state, to);
}

/// x and r take their step, and z is made of the new r.
template <int D>
__global__ void __launch_bounds__(gradient_tuning::threads) advance_frames_kernel(gradient_vectors v, int turn) {
  begin_early();
  const gradient_state& state = v.states[turn];
  if (state.ended != 0) return;
  const double pq = detail::sum_of_block<gradient_tuning::threads>(v.product, v.free_frames);
  const bool lost = !(pq > 0) || !detail::is_finite(pq);
  const int f = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (f == 0) *v.lost = lost ? 1 : 0;
  if (lost || f >= v.free_frames) return;
  const double alpha = state.rz / pq;
  combine_frames<D>{v.x, alpha, v.p, v.x, nullptr}(f);
  combine_frames<D>{v.r, -alpha, v.q, v.r, nullptr}(f);
  precondition_frames<D>{v.factors, v.r, v.z, v.residual}(f);
}

/// The next direction, and the state after the iteration.
template <int D>
__global__ void __launch_bounds__(gradient_tuning::threads)
    turn_frames_kernel(gradient_vectors v, int turn, awaited<gradient_state>* to) {
  begin_early();
  gradient_state state = v.states[turn];
  const int f = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (state.ended == 0) {
    ++state.iterations;
    if (*v.lost != 0) {
      state.ended = 1;  // what there is must do
    } else {
      const double before = state.rz;
      state.rz = detail::sum_of_block<gradient_tuning::threads>(v.residual, v.free_frames);
      state.ended = state.rz > state.enough ? 0 : 1;
      if (f < v.free_frames) combine_frames<D>{v.z, state.rz / before, v.p, v.p, nullptr}(f);
    }
  }
  if (f != 0) return;
  v.states[1 - turn] = state;
  detail::hand_over(state, to);
}

template <class Derived>
void launch_begin_gradients(const thrust::cuda_cub::execution_policy<Derived>& policy, const gradient_vectors& vectors,
                            double tolerance, awaited<gradient_state>* to) {
  to->ready = 0;
  constexpr int threads = gradient_tuning::begin_threads;
  launch_early(policy, "launch of begin_gradients", 0, begin_gradients_kernel<threads>, 1, threads, vectors, tolerance,
               to);
}

template <int V, int D, class Derived, class A>
void launch_gradient_iteration(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                               const damping& damping, double* y, const gradient_vectors& vectors, int turn,
                               awaited<gradient_state>* to) {
  constexpr int landmarks = landmark_tuning::landmarks, threads = gradient_tuning::threads;
  const std::int32_t* ended = &vectors.states[turn].ended;
  const int blocks = (vectors.free_frames + threads - 1) / threads;
  to->ready = 0;
  launch_early(policy, "launch of gather_landmarks", 0, gather_landmarks_kernel<A, V, D>,
               (s.landmarks + landmarks - 1) / landmarks, landmark_tuning::threads,
               gather_landmarks<A, V, D>{s, vectors.p, y}, ended);
  launch_early(policy, "launch of multiply_frames", 0, multiply_frames_kernel<A, V, D>, s.free_frames,
               warp_size * schur_product_tuning::warps, multiply_frames<A, V, D>{s, vectors.p, y, damping, vectors.q},
               vectors.product, ended);
  launch_early(policy, "launch of advance_frames", 0, advance_frames_kernel<D>, blocks, threads, vectors, turn);
  launch_early(policy, "launch of turn_frames", 0, turn_frames_kernel<D>, blocks, threads, vectors, turn, to);
}

TURBOMAP_END_NAMESPACE
