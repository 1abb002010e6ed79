// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sums over the lanes of a warp. Their order is fixed, so the same numbers give the same bits each time.

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

inline constexpr int warp_size = 32;
inline constexpr unsigned whole_warp = 0xffffffffU;

/// The sum over each group of `Width` lanes that follow each other, in all of them. All lanes of the warp take part.
template <int Width, class T>
__device__ inline T sum_lanes(T x) {
  static_assert(Width > 0 && Width <= warp_size && (Width & (Width - 1)) == 0);
#pragma unroll
  for (int d = Width / 2; d > 0; d /= 2) x += __shfl_xor_sync(whole_warp, x, d);
  return x;
}

/// The sums over the lanes of a warp of N numbers each, written to `out` by the lanes in turn. A lane hands half of its
/// numbers on and keeps the sums of the other half, until it has one of 32: 31 exchanges instead of 5 per number.
template <int N, class A>
__device__ inline void sum_warp(const A (&x)[N], double* out) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
#pragma unroll
  for (int begin = 0; begin < N; begin += warp_size) {
    A v[warp_size];
#pragma unroll
    for (int i = 0; i < warp_size; ++i) v[i] = begin + i < N ? x[begin + i < N ? begin + i : 0] : A(0);
#pragma unroll
    for (int d = warp_size / 2; d > 0; d /= 2) {
      const bool upper = (lane & d) != 0;
#pragma unroll
      for (int i = 0; i < d; ++i) {
        const A kept = upper ? v[i + d] : v[i], given = upper ? v[i] : v[i + d];
        v[i] = kept + __shfl_xor_sync(whole_warp, given, d);
      }
    }
    if (begin + lane < N) out[begin + lane] = static_cast<double>(v[0]);
  }
}

TURBOMAP_END_NAMESPACE
