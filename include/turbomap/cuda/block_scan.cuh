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
template <int Threads>
__device__ inline void sum_warps(int of_this_warp, int& before, int& all) {
  constexpr int warps = Threads / warp_size;
  __shared__ int of_warp[warps];
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
template <int Threads>
__device__ inline void scan_block(int mine, int& before, int& all) {
  const int up_to = sum_up_to_lane(mine);
  detail::sum_warps<Threads>(up_to, before, all);
  before += up_to - mine;
}
/// How many threads before this one, and in all, say `mine`. All `Threads` threads of the block take part.
template <int Threads>
__device__ inline void count_block(bool mine, int& before, int& all) {
  const unsigned which = __ballot_sync(whole_warp, mine), lane = threadIdx.x % warp_size;
  detail::sum_warps<Threads>(__popc(which), before, all);
  before += __popc(which & ((1U << lane) - 1));
}

TURBOMAP_END_NAMESPACE
