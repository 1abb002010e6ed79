// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_eliminate_landmarks() under a CUDA policy: a few lanes per landmark instead of one thread. They share the rows of
/// the landmark, add their sums up in a fixed order, factorise the same block each, and take the couplings through it in turn.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../eliminate_landmarks.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The sum of the rows of landmark l, in all lanes of its group. \param l  may be beyond the last: no rows
template <int Lanes, class A>
__device__ inline void sum_rows_of_group(const schur_view<A>& s, int l, int lane, double (&total)[9]) {
  for (int i = 0; i < 9; ++i) total[i] = 0;
  if (l < s.landmarks)
    for (int r = s.landmark_row[l] + lane; r < s.landmark_row[l + 1]; r += Lanes) {
      const A* row = s.sums.row + static_cast<std::ptrdiff_t>(r) * 9;
      for (int i = 0; i < 9; ++i) total[i] += static_cast<double>(row[i]);
    }
  for (int i = 0; i < 9; ++i) total[i] = sum_lanes<Lanes>(total[i]);
}

template <class A, int V>
__global__ void __launch_bounds__(landmark_tuning::threads) eliminate_landmarks_kernel(eliminate_landmarks<A, V> work) {
  constexpr int lanes = landmark_tuning::lanes;
  const schur_view<A>& s = work.s;
  const int thread = static_cast<int>(threadIdx.x), lane = thread % lanes;
  const int l = static_cast<int>(blockIdx.x) * landmark_tuning::landmarks + thread / lanes;
  double h[9];
  sum_rows_of_group<lanes>(s, l, lane, h);
  if (l >= s.landmarks) return;
  const eliminated_landmark e = work.eliminate(l, h);
  if (lane == 0) s.landmark[l] = e;
  const auto inverse = work.factor_of(e);
  for (int slot = s.landmark_slot[l] + lane; slot < s.landmark_slot[l + 1]; slot += lanes)
    work.take_through(slot, inverse);
}

template <int V, class Derived, class A>
void launch_eliminate_landmarks(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                                const damping& damping) {
  constexpr int landmarks = landmark_tuning::landmarks;
  launch_kernel(policy, "launch of eliminate_landmarks", eliminate_landmarks_kernel<A, V>,
                (s.landmarks + landmarks - 1) / landmarks, landmark_tuning::threads,
                eliminate_landmarks<A, V>{s, damping});
}

TURBOMAP_END_NAMESPACE
