// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_list_blocks() under a CUDA policy. A table says which slot a free frame has with a landmark, if any; a warp per two
/// frames goes through the slots of the first one and looks the second one up: first to count, then, when a scan has told
/// where each list begins, to write.

#include <cstddef>
#include <cstdint>
#include <limits>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../list_blocks.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What the kernels work on.
struct block_listing {
  /// @{
  /// As of sum_lists.
  const std::int32_t *frame_slot, *slot_list, *slot_landmark, *slot_frame;
  /// @}
  /// @{
  /// How many there are.
  int free_frames, landmarks, slots, blocks;
  /// @}
  std::int32_t* slot_of;  ///< [free frame][landmark]; -1: none
  /// @{
  /// As of block_lists.
  std::int32_t *row, *column;
  /// @}
  std::int32_t* begin;  ///< [block + 1]: lengths, then where each list begins
  slot_pair* pairs;     ///< as of block_lists; read only where Write
};

/// Index = slot.
struct enter_slot {
  block_listing w;  ///< the table
  /// One slot.
  TURBOMAP_HD void operator()(int slot) const {
    w.slot_of[static_cast<std::ptrdiff_t>(w.slot_frame[slot]) * w.landmarks + w.slot_landmark[slot]] = slot;
  }
};

/// \tparam Write  the lists; else their lengths
template <class Tuning, bool Write>
__global__ void __launch_bounds__(Tuning::threads) list_pairs_kernel(block_listing w) {
  const int warp = (static_cast<int>(blockIdx.x) * Tuning::threads + static_cast<int>(threadIdx.x)) / warp_size;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, i = warp / w.free_frames, j = warp % w.free_frames;
  if (i >= j || i >= w.free_frames) return;
  const int block = i * (2 * w.free_frames - i - 1) / 2 + j - i - 1;
  const std::int32_t* const other = w.slot_of + static_cast<std::ptrdiff_t>(j) * w.landmarks;
  const int end = w.frame_slot[i + 1];
  int at = Write ? w.begin[block] : 0;
  constexpr int looks = 4;  // at a time: each is three loads, one after the other
  for (int k = w.frame_slot[i] + lane; k - lane < end; k += looks * warp_size) {
    int slot[looks], second[looks];
#pragma unroll
    for (int m = 0; m < looks; ++m) slot[m] = k + m * warp_size < end ? w.slot_list[k + m * warp_size] : -1;
#pragma unroll
    for (int m = 0; m < looks; ++m) second[m] = slot[m] < 0 ? -1 : w.slot_landmark[slot[m]];
#pragma unroll
    for (int m = 0; m < looks; ++m) second[m] = second[m] < 0 ? -1 : other[second[m]];
#pragma unroll
    for (int m = 0; m < looks; ++m) {
      const unsigned shared = __ballot_sync(whole_warp, second[m] >= 0);
      if (Write && second[m] >= 0) w.pairs[at + __popc(shared & ((1U << lane) - 1))] = {slot[m], second[m]};
      at += __popc(shared);
    }
  }
  if (!Write && lane == 0) w.row[block] = i, w.column[block] = j, w.begin[block + 1] = at;
}

/// One block: where each list begins, from their lengths.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads) begin_lists_kernel(block_listing w) {
  constexpr int warps = Tuning::scan_threads / warp_size;
  __shared__ int of_warp[warps];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size, warp = thread / warp_size;
  const int each = (w.blocks + Tuning::scan_threads - 1) / Tuning::scan_threads;
  const int first = thread * each < w.blocks ? thread * each : w.blocks;
  const int last = first + each < w.blocks ? first + each : w.blocks;
  int own = 0;
  for (int i = first; i < last; ++i) own += w.begin[i + 1];
  int before = own;
  for (int d = 1; d < warp_size; d *= 2) {
    const int x = __shfl_up_sync(whole_warp, before, d);
    if (lane >= d) before += x;
  }
  if (lane == warp_size - 1) of_warp[warp] = before;
  __syncthreads();
  before -= own;
  for (int i = 0; i < warp; ++i) before += of_warp[i];
  if (thread == 0) w.begin[0] = 0;
  for (int i = first; i < last; ++i) w.begin[i + 1] = before += w.begin[i + 1];
}

template <class Derived, class Arena, class A>
bool launch_list_blocks(const thrust::cuda_cub::execution_policy<Derived>& policy, Arena& scratch,
                        const adjustment_structure& s, schur_view<A>& view) {
  using tuning = list_blocks_tuning;
  const int frames = s.free_frames;
  const std::int64_t pairs = block_finder::count_pairs(s);
  if (!s.frame_pairs.empty() || frames > tuning::frames || pairs > std::numeric_limits<std::int32_t>::max())
    return false;
  const int blocks = frames * (frames - 1) / 2;
  const auto at = [](std::int64_t i) { return static_cast<std::size_t>(i); };
  const std::size_t table = at(frames) * at(s.landmarks);
  block_listing w{view.frame_slot,
                  view.slot_list,
                  view.slot_landmark,
                  view.slot_frame,
                  frames,
                  s.landmarks,
                  static_cast<int>(s.slots()),
                  blocks,
                  nullptr,
                  nullptr,
                  nullptr,
                  nullptr,
                  nullptr};
  w.slot_of = scratch.template take<std::int32_t>(table);
  w.row = scratch.template take<std::int32_t>(at(blocks));
  w.column = scratch.template take<std::int32_t>(at(blocks));
  w.begin = scratch.template take<std::int32_t>(at(blocks) + 1);
  w.pairs = scratch.template take<slot_pair>(at(pairs));
  std::int32_t* const no_factors = scratch.template take<std::int32_t>(at(blocks) + 1);

  fill_bytes(policy, w.slot_of, 0xff, table * sizeof(std::int32_t));
  fill_bytes(policy, no_factors, 0, (at(blocks) + 1) * sizeof(std::int32_t));
  for_each_index(policy, w.slots, enter_slot{w});
  constexpr int warps = tuning::threads / warp_size;
  const int grid = (frames * frames + warps - 1) / warps;
  launch_kernel(policy, "launch of list_pairs", list_pairs_kernel<tuning, false>, grid, tuning::threads, w);
  launch_kernel(policy, "launch of begin_lists", begin_lists_kernel<tuning>, 1, tuning::scan_threads, w);
  launch_kernel(policy, "launch of list_pairs", list_pairs_kernel<tuning, true>, grid, tuning::threads, w);

  view.blocks = blocks;
  view.block_row = w.row, view.block_column = w.column, view.block_pair = w.begin, view.pairs = w.pairs;
  view.block_factor = no_factors, view.factor_list = nullptr;
  return true;
}

TURBOMAP_END_NAMESPACE
