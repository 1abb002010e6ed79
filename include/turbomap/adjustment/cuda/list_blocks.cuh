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
#include "../../cuda/block_scan.cuh"
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
  /// @{
  /// Factors between frames: as of sum_lists, and block_factor and factor_list of block_lists.
  const std::int32_t* frame_pair;
  const frame_neighbour* neighbours;
  std::int32_t *factor_begin, *factor_list;
  /// @}
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
  begin_early();
  const int warp = (static_cast<int>(blockIdx.x) * Tuning::threads + static_cast<int>(threadIdx.x)) / warp_size;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, i = warp / w.free_frames, j = warp % w.free_frames;
  if (i >= j || i >= w.free_frames) return;
  const int block = i * (2 * w.free_frames - i - 1) / 2 + j - i - 1;
  const std::int32_t* const other = w.slot_of + static_cast<std::ptrdiff_t>(j) * w.landmarks;
  const int end = w.frame_slot[i + 1];
  int at = Write ? w.begin[block] : 0;
  constexpr int looks = 16;  // at a time: each is three loads, one after the other
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
  if (lane != 0) return;
  if (!Write) w.row[block] = i, w.column[block] = j, w.begin[block + 1] = at;
  int factors = Write ? w.factor_begin[block] : 0;
  for (int k = w.frame_pair[i]; k < w.frame_pair[i + 1]; ++k) {
    const frame_neighbour n = w.neighbours[k];
    if (n.other != j) continue;
    if (Write) w.factor_list[factors] = 2 * n.factor + (n.is_first != 0 ? 0 : 1);
    ++factors;
  }
  if (!Write) w.factor_begin[block + 1] = factors;
}

/// One block: where each list begins, from their lengths. \param begin  [blocks + 1]
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads) begin_lists_kernel(int blocks, std::int32_t* begin) {
  begin_early();
  const int thread = static_cast<int>(threadIdx.x), each = (blocks + Tuning::scan_threads - 1) / Tuning::scan_threads;
  const int first = thread * each < blocks ? thread * each : blocks;
  const int last = first + each < blocks ? first + each : blocks;
  int own = 0;
  for (int i = first; i < last; ++i) own += begin[i + 1];
  int before, all;
  scan_block<Tuning::scan_threads>(own, before, all);
  if (thread == 0) begin[0] = 0;
  for (int i = first; i < last; ++i) begin[i + 1] = before += begin[i + 1];
}

template <class Derived, class Arena, class A>
bool launch_list_blocks(const thrust::cuda_cub::execution_policy<Derived>& policy, Arena& scratch,
                        const adjustment_structure& s, schur_view<A>& view) {
  using tuning = list_blocks_tuning;
  const int frames = s.free_frames;
  const std::int64_t pairs = block_finder::count_pairs(s);
  if (frames > tuning::frames || pairs > std::numeric_limits<std::int32_t>::max()) return false;
  const int blocks = frames * (frames - 1) / 2;
  const auto at = [](std::int64_t i) { return static_cast<std::size_t>(i); };
  const std::size_t table = at(frames) * at(s.landmarks);
  if (table > tuning::most_of_table) return false;
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
                  nullptr,
                  view.frame_pair,
                  view.neighbours,
                  nullptr,
                  nullptr};
  w.slot_of = scratch.template take<std::int32_t>(table);
  w.row = scratch.template take<std::int32_t>(at(blocks));
  w.column = scratch.template take<std::int32_t>(at(blocks));
  w.begin = scratch.template take<std::int32_t>(at(blocks) + 1);
  w.pairs = scratch.template take<slot_pair>(at(pairs));
  w.factor_begin = scratch.template take<std::int32_t>(at(blocks) + 1);
  w.factor_list = scratch.template take<std::int32_t>(s.frame_pairs.size());

  fill_bytes(policy, w.slot_of, 0xff, table * sizeof(std::int32_t));
  for_each_index(policy, w.slots, enter_slot{w});
  constexpr int warps = tuning::threads / warp_size;
  const int grid = (frames * frames + warps - 1) / warps;
  launch_early(policy, "launch of list_pairs", 0, list_pairs_kernel<tuning, false>, grid, tuning::threads, w);
  for (std::int32_t* const lengths : {w.begin, w.factor_begin})
    launch_early(policy, "launch of begin_lists", 0, begin_lists_kernel<tuning>, 1, tuning::scan_threads, blocks,
                 lengths);
  launch_early(policy, "launch of list_pairs", 0, list_pairs_kernel<tuning, true>, grid, tuning::threads, w);

  view.blocks = blocks;
  view.block_row = w.row, view.block_column = w.column, view.block_pair = w.begin, view.pairs = w.pairs;
  view.block_factor = w.factor_begin, view.factor_list = w.factor_list;
  return true;
}

TURBOMAP_END_NAMESPACE
