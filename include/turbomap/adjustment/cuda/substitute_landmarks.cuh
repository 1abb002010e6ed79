// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_substitute_landmarks() under a CUDA policy: a few lanes per landmark share its slots. A block has the landmarks of
/// one index of the generic body, whose gains one thread adds up in their order. launch_take_step() moves the frames in
/// further blocks of the same kernel.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../substitute_landmarks.hpp"
#include "eliminate_landmarks.cuh"
#include "load_numbers.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A block of landmarks.
template <class A, int V, int D>
__device__ inline void substitute_block(const substitute_landmarks<A, V, D>& work) {
  constexpr int lanes = landmark_tuning::lanes, landmarks = landmark_tuning::landmarks;
  static_assert(landmarks == substitute_landmarks<A, V, D>::landmarks_per_index);
  __shared__ double gains[landmarks];
  const schur_view<A>& s = work.s;
  const int thread = static_cast<int>(threadIdx.x), lane = thread % lanes, index = static_cast<int>(blockIdx.x);
  const int l = index * landmarks + thread / lanes;
  double y[3] = {};
  if (l < s.landmarks)
    for (int slot = s.landmark_slot[l] + lane; slot < s.landmark_slot[l + 1]; slot += lanes) {
      A z[3 * V];
      detail::load_numbers(s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V, z);
      const double* const step = work.step + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * D;
      double x[V];
      if constexpr (D % 2 == 0) {
        detail::load_numbers(step, x);
      } else {
        for (int v = 0; v < V; ++v) x[v] = step[v];
      }
      for (int m = 0; m < 3; ++m)
        for (int v = 0; v < V; ++v) y[m] -= static_cast<double>(z[m * V + v]) * x[v];
    }
  for (int m = 0; m < 3; ++m) y[m] = sum_lanes<lanes>(y[m]);
  double held[3] = {work.damping.lambda, work.damping.lambda, work.damping.lambda};
  if (work.damping.scaled) {
    double h[9];
    A own[9];
    sum_rows_of_group<lanes>(s, l, lane, h, own);
    held[0] = work.damping(h[0]), held[1] = work.damping(h[2]), held[2] = work.damping(h[5]);
  }
  if (lane == 0) {
    double gain = 0;
    if (l < s.landmarks) {
      for (int m = 0; m < 3; ++m) y[m] += s.landmark[l].c[m];
      work.move(l, y, held, gain);
    }
    gains[thread / lanes] = gain;
  }
  __syncthreads();
  if (thread != 0) return;
  double sum = 0;
  for (int i = 0; i < landmarks; ++i) sum += gains[i];
  work.predicted[index] = sum;
}

template <class A, int V, int D>
__global__ void __launch_bounds__(landmark_tuning::threads)
    substitute_landmarks_kernel(substitute_landmarks<A, V, D> work) {
  begin_early();
  substitute_block(work);
}

/// The blocks of landmarks, then those of frames.
template <class A, int V, int D, class Frame>
__global__ void __launch_bounds__(landmark_tuning::threads)
    take_step_kernel(substitute_landmarks<A, V, D> work, int landmark_blocks, retract_frames<Frame> retract,
                     int frames) {
  begin_early();
  const int block = static_cast<int>(blockIdx.x) - landmark_blocks;
  if (block < 0) return substitute_block(work);
  const int f = block * landmark_tuning::threads + static_cast<int>(threadIdx.x);
  if (f < frames) retract(f);
}

template <int V, int D, class Derived, class A>
void launch_substitute_landmarks(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                                 const double* step, const damping& damping, const double* from, double* to,
                                 double* predicted) {
  launch_early(policy, "launch of substitute_landmarks", 0, substitute_landmarks_kernel<A, V, D>,
               landmark_gain_count(s.landmarks), landmark_tuning::threads,
               substitute_landmarks<A, V, D>{s, step, damping, from, to, predicted});
}

template <int V, int D, class Frame, class Derived, class A>
void launch_take_step(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                      const double* step, const damping& damping, int frames, const estimate_view<Frame>& from,
                      const estimate_view<Frame>& to, double* predicted) {
  constexpr int threads = landmark_tuning::threads;
  const int blocks = landmark_gain_count(s.landmarks);
  launch_early(policy, "launch of take_step", 0, take_step_kernel<A, V, D, Frame>,
               blocks + (frames + threads - 1) / threads, threads,
               substitute_landmarks<A, V, D>{s, step, damping, from.landmarks, to.landmarks, predicted}, blocks,
               retract_frames<Frame>{s.free_of_frame, step, from.states, {to.states, to.poses}, to.states}, frames);
}

TURBOMAP_END_NAMESPACE
