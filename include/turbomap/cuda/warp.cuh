// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sums over the lanes of a warp. Their order is fixed, so the same numbers give the same bits each time.

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

inline constexpr int warp_size = 32;                 ///< lanes of a warp
inline constexpr unsigned whole_warp = 0xffffffffU;  ///< the mask of all lanes

/// The sum over each group of `Width` lanes that follow each other, in all of them. All lanes of the warp take part.
template <int Width, class T>
__device__ inline T sum_lanes(T x) {
  static_assert(Width > 0 && Width <= warp_size && (Width & (Width - 1)) == 0);
#pragma unroll
  for (int d = Width / 2; d > 0; d /= 2) x += __shfl_xor_sync(whole_warp, x, d);
  return x;
}

/// The sum over the lanes up to this one, this one included. All lanes of the warp take part.
template <class T>
__device__ inline T sum_up_to_lane(T x) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
#pragma unroll
  for (int d = 1; d < warp_size; d *= 2) {
    const T other = __shfl_up_sync(whole_warp, x, static_cast<unsigned>(d));
    if (lane >= d) x += other;
  }
  return x;
}

namespace detail {

/// Sums of N numbers over `Lanes` lanes: a lane hands half of its numbers on and keeps the sums of the other half.
template <int Lanes, int N, class A, int M>
__device__ inline void sum_halves(const A (&x)[N], A (&mine)[M]) {
  if constexpr (Lanes == 1) {
    static_assert(N == M);
#pragma unroll
    for (int i = 0; i < N; ++i) mine[i] = x[i];
  } else {
    constexpr int half = N / 2;
    const bool upper = (threadIdx.x & (Lanes / 2)) != 0;
    A kept[half];
#pragma unroll
    for (int i = 0; i < half; ++i)
      kept[i] = (upper ? x[i + half] : x[i]) + __shfl_xor_sync(whole_warp, upper ? x[i] : x[i + half], Lanes / 2);
    sum_halves<Lanes / 2>(kept, mine);
  }
}

}  // namespace detail

/// How many of N sums each of `Width` lanes gets.
template <int Width, int N>
inline constexpr int sums_per_lane = (N + Width - 1) / Width;

/// The sums of N numbers each over groups of `Width` lanes that follow each other. Lane l of a group gets those from
/// l sums_per_lane on; what is beyond N is 0. About N exchanges, where N times sum_lanes() takes N log2(Width).
template <int Width, int N, class A>
__device__ inline void sum_numbers(const A (&x)[N], A (&mine)[sums_per_lane<Width, N>]) {
  A padded[sums_per_lane<Width, N> * Width];
#pragma unroll
  for (int i = 0; i < sums_per_lane<Width, N> * Width; ++i) padded[i] = i < N ? x[i < N ? i : 0] : A(0);
  detail::sum_halves<Width>(padded, mine);
}

namespace detail {

/// Sums of N numbers, of which the first `count` count, over `Lanes` lanes, to out[first...]. As sum_halves(), but the numbers
/// need not be as many as the lanes, nor a multiple of them.
template <int Lanes, int N, class A>
__device__ inline void write_sums(const A (&x)[N], int first, int count, double* out) {
  if constexpr (Lanes == 1) {
#pragma unroll
    for (int i = 0; i < N; ++i)
      if (i < count) out[first + i] = static_cast<double>(x[i]);
  } else {
    constexpr int half = (N + 1) / 2;
    const bool upper = (threadIdx.x & (Lanes / 2)) != 0;
    A kept[half];
#pragma unroll
    for (int i = 0; i < half; ++i) {
      const A other = i + half < N ? x[i + half < N ? i + half : 0] : A(0);
      kept[i] = (upper ? other : x[i]) + __shfl_xor_sync(whole_warp, upper ? x[i] : other, Lanes / 2);
    }
    write_sums<Lanes / 2>(kept, upper ? first + half : first, upper ? count - half : count < half ? count : half, out);
  }
}

}  // namespace detail

/// The sums of N numbers over a whole warp, written to `out`. About N exchanges.
template <int N, class A>
__device__ inline void sum_warp(const A (&x)[N], double* out) {
  detail::write_sums<warp_size>(x, 0, N, out);
}

TURBOMAP_END_NAMESPACE
