// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sums over the threads of a block that come before each of them (prefix sums), of whole numbers and of flags.

#include "../config.hpp"
#include "warp.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The sums over the warps before this one, and over all. \param of_this_warp  looked at in its last lane
template <int Threads, class T>
__device__ inline void sum_warps(T of_this_warp, T& before, T& all) {
  constexpr int warps = Threads / warp_size;
  __shared__ T of_warp[warps];
  const int thread = static_cast<int>(threadIdx.x), warp = thread / warp_size;
  if (thread % warp_size == warp_size - 1) of_warp[warp] = of_this_warp;
  __syncthreads();
  before = all = 0;
#pragma unroll
  for (int w = 0; w < warps; ++w) before += w < warp ? of_warp[w] : 0, all += of_warp[w];
  __syncthreads();  // the next call writes
}

}  // namespace detail

/// The sums of `mine` over the threads before this one, and over all. All `Threads` threads of the block take part.
template <int Threads, class T>
__device__ inline void scan_block(T mine, T& before, T& all) {
  const T up_to = sum_up_to_lane(mine);
  detail::sum_warps<Threads>(up_to, before, all);
  before += up_to - mine;
}
/// How many numbers in a row a thread of scan_by_block() reads.
inline constexpr int scanned_at_once = 8;

/// The sums before each of n numbers, by one block: read(first, x) fills x with those from number `first` on, 0 beyond the n;
/// write(first, sums) is told of as many, also beyond the n. Returns the sum of all.
template <int Threads, class T, class Read, class Write>
__device__ inline T scan_by_block(int n, Read read, Write write) {
  constexpr int each = scanned_at_once;
  T before_all = 0;
  for (int base = 0; base < n; base += Threads * each) {
    const int first = base + static_cast<int>(threadIdx.x) * each;
    T x[each], sum = 0;
    read(first, x);
#pragma unroll
    for (int k = 0; k < each; ++k) sum += x[k];
    T before, all;
    scan_block<Threads>(sum, before, all);
    before += before_all, before_all += all;
#pragma unroll
    for (int k = 0; k < each; ++k) {
      const T own = x[k];
      x[k] = before, before += own;
    }
    write(first, x);
  }
  return before_all;
}
/// How many threads before this one, and in all, say `mine`. All `Threads` threads of the block take part.
template <int Threads>
__device__ inline void count_block(bool mine, int& before, int& all) {
  const unsigned which = __ballot_sync(whole_warp, mine), lane = threadIdx.x % warp_size;
  detail::sum_warps<Threads>(__popc(which), before, all);
  before += __popc(which & ((1U << lane) - 1));
}

TURBOMAP_END_NAMESPACE
