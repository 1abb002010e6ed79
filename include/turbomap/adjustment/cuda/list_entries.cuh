// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The last kernel of launch_order_observations(): the lists of a frame are made by a block that goes through all rows and keeps its
/// own, in their order.

#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../observation_lists.hpp"
#include "sort_observations.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Calls take(number of the item, place) for the items of a list that are of one bin, in their order, by one block.
/// \param bin_of  [item] not negative; aligned for int4
template <int Threads, class Take>
__device__ inline void keep_bin(const std::int32_t* bin_of, int n, int bin, Take take) {
  constexpr int warps = Threads / warp_size, each = 16;
  __shared__ int of_warp[2][warps];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size, warp = thread / warp_size;
  int before_all = 0, turn = 0;
  for (int base = 0; base < n; base += Threads * each, turn = 1 - turn) {
    const int first = base + thread * each;
    unsigned mine = 0;
#pragma unroll
    for (int k = 0; k < each; k += 4) {
      int4 four{-1, -1, -1, -1};
      if (first + k + 4 <= n) {
        four = *reinterpret_cast<const int4*>(bin_of + first + k);
      } else {
        if (first + k < n) four.x = bin_of[first + k];
        if (first + k + 1 < n) four.y = bin_of[first + k + 1];
        if (first + k + 2 < n) four.z = bin_of[first + k + 2];
      }
      mine |= (four.x == bin ? 1U : 0U) << k | (four.y == bin ? 2U : 0U) << k;
      mine |= (four.z == bin ? 4U : 0U) << k | (four.w == bin ? 8U : 0U) << k;
    }
    const int own = __popc(mine);
    int before = sum_up_to_lane(own);
    if (lane == warp_size - 1) of_warp[turn][warp] = before;
    __syncthreads();  // one is enough: the next turn writes beside
    before += before_all - own;
    for (int i = 0; i < warps; ++i) {
      if (i < warp) before += of_warp[turn][i];
      before_all += of_warp[turn][i];
    }
#pragma unroll
    for (int k = 0; k < each; ++k)
      if ((mine >> k & 1U) != 0) take(first + k, before++);
  }
}

}  // namespace detail

/// A block per bin: its entries and chunks. Then one per free frame: its slots.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::bin_threads, 1) list_entries_kernel(observation_work w) {
  constexpr int threads = Tuning::bin_threads, padding = observation_padding;
  begin_early();
  if (w.report->too_long != 0) return;
  const int thread = static_cast<int>(threadIdx.x), bins = w.frames * w.kinds;
  if (static_cast<int>(blockIdx.x) >= bins) {
    const int f = static_cast<int>(blockIdx.x) - bins;
    std::int32_t* const list = w.slot_list + w.frame_slot[f];
    detail::keep_bin<threads>(w.slot_frame, w.landmark_slot[w.landmarks], f,
                              [&](int slot, int at) { list[at] = slot; });
    return;
  }
  const int bin = static_cast<int>(blockIdx.x), key = bin / w.kinds, count = w.bin_rows[bin];
  if (count == 0) return;
  const int first_chunk = w.bin_chunk[bin], begin = first_chunk * padding;
  const int end = begin + (count + padding - 1) / padding * padding;
  for (int c = first_chunk + thread; c * padding < end; c += threads) {
    const int rest = begin + count - c * padding;
    w.chunks[c] = {w.frame_of_key[key], key < w.free_frames ? key : -1, bin % w.kinds, c * padding,
                   rest < padding ? rest : padding};
    if (key < w.free_frames) w.partial_list[c] = c;
  }
  detail::keep_bin<threads>(w.row_bin, w.rows, bin, [&](int row, int at) {
    w.row[begin + at] = row;
    for (int i = begin + count; at == count - 1 && i < end; ++i) w.row[i] = row;  // padding repeats the last one
  });
  __syncthreads();  // what follows from the row is looked up by all threads: few have rows of a bin in one turn
  for (int i = begin + thread; i < end; i += threads) {
    const int row = w.row[i], o = w.source_of(w.ordered[row]);
    w.source[i] = o, w.entry_landmark[i] = w.landmark[o], w.coupling[i] = w.row_coupling[row];
  }
}

TURBOMAP_END_NAMESPACE
