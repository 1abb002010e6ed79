// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_eliminate_landmarks() under a CUDA policy: a few lanes per landmark instead of one thread. They share the rows of
/// the landmark, add their sums up in a fixed order, factorise the same block each, and take the couplings through it in turn.
/// launch_sum_and_eliminate() has further blocks that sum the frames, which landmarks need not wait for.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../eliminate_landmarks.hpp"
#include "../frame_sums.hpp"
#include "load_numbers.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The sum of the rows of landmark l, in all lanes of its group. \param l  may be beyond the last: no rows
/// \param own  the first row that the lane has
template <int Lanes, class A>
__device__ inline void sum_rows_of_group(const schur_view<A>& s, int l, int lane, double (&total)[9], A (&own)[9]) {
  for (int i = 0; i < 9; ++i) total[i] = 0, own[i] = 0;
  if (l < s.landmarks) {
    const int begin = s.landmark_row[l] + lane, end = s.landmark_row[l + 1];
    for (int r = begin; r < end; r += Lanes) {
      const A* row = s.sums.row + static_cast<std::ptrdiff_t>(r) * 9;
      for (int i = 0; i < 9; ++i) {
        const A x = row[i];
        if (r == begin) own[i] = x;
        total[i] += static_cast<double>(x);
      }
    }
  }
  for (int i = 0; i < 9; ++i) total[i] = sum_lanes<Lanes>(total[i]);
}

/// The coupling of a slot of landmark l, made of its rows: a reprojection depends on both through the point X = R p + t, so
/// with the block H of the landmark it is ([X]x R; R) H, as row_couplings.hpp explains.
/// \param own,own_row  a row that the lane has, and which one: mostly that of the slot
template <int V, class A>
__device__ inline void couple_slot(const schur_view<A>& s, int l, int slot, const A (&own)[9], int own_row,
                                   pack<A, column_lanes<V>> (&w)[3]) {
  const int free = s.slot_frame[slot], first = s.slot_coupling[slot], count = s.slot_coupling[slot + 1] - first;
  const int row = s.landmark_row[l] + first - s.slot_coupling[s.landmark_slot[l]];  // free frames come first
  A h[6] = {};
  if (count == 1 && row == own_row)
    for (int i = 0; i < 6; ++i) h[i] = own[i];
  else
    for (int k = row; k < row + count; ++k)
      for (int i = 0; i < 6; ++i) h[i] += s.sums.row[static_cast<std::ptrdiff_t>(k) * landmark_block<V>::row + i];
  double pose[12];
  static_assert(sizeof pose == sizeof(isometry<double>));
  detail::load_numbers(reinterpret_cast<const double*>(s.poses + s.frame_of_free[free]), pose);
  isometry<double> T;
  for (int i = 0; i < 9; ++i) T.R.m[i] = pose[i];
  T.t = {pose[9], pose[10], pose[11]};
  const double* p = s.positions + static_cast<std::ptrdiff_t>(l) * landmark_stride;
  const vec3<double> body = T * vec3<double>{p[0], p[1], p[2]};
  const A X[3] = {static_cast<A>(body.x), static_cast<A>(body.y), static_cast<A>(body.z)};
  const std::uint32_t mask = s.held == nullptr ? 0 : s.held[free];
  const A H[9] = {h[0], h[1], h[3], h[1], h[2], h[4], h[3], h[4], h[5]};
#pragma unroll
  for (int m = 0; m < 3; ++m) {
    A v[3], column[column_lanes<V>];
#pragma unroll
    for (int k = 0; k < 3; ++k)
      v[k] = static_cast<A>(T.R.m[3 * k]) * H[m] + static_cast<A>(T.R.m[3 * k + 1]) * H[3 + m] +
             static_cast<A>(T.R.m[3 * k + 2]) * H[6 + m];
    column[0] = X[1] * v[2] - X[2] * v[1], column[1] = X[2] * v[0] - X[0] * v[2], column[2] = X[0] * v[1] - X[1] * v[0];
    column[3] = v[0], column[4] = v[1], column[5] = v[2];
#pragma unroll
    for (int i = 0; i < column_lanes<V>; ++i)
      if (i >= 6 || (mask >> i & 1U) != 0) column[i] = A(0);
    w[m] = pack<A, column_lanes<V>>::load(column);
  }
}

/// The landmark of a group of lanes. \param thread  number among the threads of all landmarks
template <class A, int V>
__device__ inline void eliminate_by_group(const eliminate_landmarks<A, V>& work, int thread) {
  constexpr int lanes = landmark_tuning::lanes;
  const schur_view<A>& s = work.s;
  const int lane = thread % lanes, l = thread / lanes;
  double h[9];
  A own[9];
  sum_rows_of_group<lanes>(s, l, lane, h, own);
  if (l >= s.landmarks) return;
  const eliminated_landmark e = work.eliminate(l, h);
  if (lane == 0) s.landmark[l] = e;
  const auto inverse = work.factor_of(e);
  for (int slot = s.landmark_slot[l] + lane; slot < s.landmark_slot[l + 1]; slot += lanes)
    if (s.sums.coupling != nullptr) {
      work.take_through(slot, inverse);
    } else if constexpr (V >= 6) {
      typename eliminate_landmarks<A, V>::P w[3], z[3];
      couple_slot<V>(s, l, slot, own, s.landmark_row[l] + lane, w);
      work.multiply(w, inverse, z);
      A columns[3 * V];
#pragma unroll
      for (int i = 0; i < 3 * V; ++i) columns[i] = z[i / V].v[i % V];
      detail::store_numbers(columns, s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V);
    }
}

template <class A, int V>
__global__ void __launch_bounds__(landmark_tuning::threads) eliminate_landmarks_kernel(eliminate_landmarks<A, V> work) {
  begin_early();
  if (work.s.lambda != nullptr) work.damping.lambda = *work.s.lambda;
  if (isnan(work.damping.lambda)) return;
  eliminate_by_group(work, static_cast<int>(blockIdx.x) * landmark_tuning::threads + static_cast<int>(threadIdx.x));
}

/// The blocks of frames, then those of landmarks, which need the damping.
template <class A, int V, int D>
__global__ void __launch_bounds__(warp_size* sum_frames_tuning::warps)
    sum_and_eliminate_kernel(eliminate_landmarks<A, V> work) {
  begin_early();
  const int block = static_cast<int>(blockIdx.x) - work.s.free_frames;
  if (block < 0) return sum_frame<A, V, D>(work.s, static_cast<int>(blockIdx.x));
  if (work.s.lambda != nullptr) work.damping.lambda = *work.s.lambda;
  if (isnan(work.damping.lambda)) return;
  eliminate_by_group(work, block * warp_size * sum_frames_tuning::warps + static_cast<int>(threadIdx.x));
}

template <int V, class Derived, class A>
void launch_eliminate_landmarks(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                                const damping& damping) {
  constexpr int landmarks = landmark_tuning::landmarks;
  launch_early(policy, "launch of eliminate_landmarks", 0, eliminate_landmarks_kernel<A, V>,
               (s.landmarks + landmarks - 1) / landmarks, landmark_tuning::threads,
               eliminate_landmarks<A, V>{s, damping});
}

template <int V, int D, class Derived, class A>
void launch_sum_and_eliminate(const thrust::cuda_cub::execution_policy<Derived>& policy, const schur_view<A>& s,
                              const damping& damping) {
  constexpr int threads = warp_size * sum_frames_tuning::warps, landmarks = threads / landmark_tuning::lanes;
  if constexpr (sizeof(double) * sum_frames_tuning::warps * frame_block<D>::partial > shared_memory_bytes) {
    launch_sum_frames<V, D>(policy, s);
    launch_eliminate_landmarks<V>(policy, s, damping);
  } else {
    launch_early(policy, "launch of sum_and_eliminate", 0, sum_and_eliminate_kernel<A, V, D>,
                 s.free_frames + (s.landmarks + landmarks - 1) / landmarks, threads,
                 eliminate_landmarks<A, V>{s, damping});
  }
}

TURBOMAP_END_NAMESPACE
