// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Kernels of launch_order_observations(): rows are counted per landmark and put beside those of the same one, in any order; a warp per
/// landmark then sorts its few rows by (frame, place in the input), which is one order only.

#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/block_scan.cuh"
#include "../../cuda/last_block.cuh"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../observation_lists.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What the kernels work on.
struct observation_work : observation_input, observation_lists {
  observation_report* report;            ///< where the policy computes
  std::int32_t* bin_rows;                ///< [frame by its key, kind] rows, counted
  std::int32_t* bin_chunk;               ///< [+ 1] its first chunk
  std::int32_t* row_count;               ///< [landmark]
  std::int32_t* slot_count;              ///< [landmark] and `moves`
  std::int32_t* free_count;              ///< [landmark] couplings
  std::int32_t* frame_count;             ///< [free frame] slots
  std::int32_t* coupling_of;             ///< [landmark + 1] its first one
  std::int32_t* place;                   ///< [row of the input] among those of its landmark, in any order
  std::uint64_t* mixed;                  ///< [row] (key of the frame, row of the input), in any order within a landmark
  std::uint64_t* ordered;                ///< [row] the same in their order
  std::int32_t* row_bin;                 ///< [row]
  std::int32_t* row_coupling;            ///< [row] -1: of a fixed frame
  unsigned* arrived;                     ///< [2] blocks of count_rows and sort_rows that are done
  static constexpr int moves = 1 << 30;  ///< added to a slot_count: the landmark has rows and is not fixed

  /// Of an element of `mixed`: the key of its frame.
  __device__ static int key_of(std::uint64_t row) { return static_cast<int>(row >> 32); }
  /// The row of the input.
  __device__ static int source_of(std::uint64_t row) { return static_cast<int>(row & 0xffffffffU); }
};

namespace detail {

/// Numbers that other blocks wrote, for scan_by_block(). \param from  aligned for int4; may be read up to a multiple of 8
__device__ inline void read_numbers(const std::int32_t* from, int n, int first, int (&x)[scanned_at_once]) {
  static_assert(scanned_at_once == 8);
  int4 half[2] = {};
  if (first < n) half[0] = __ldcg(reinterpret_cast<const int4*>(from + first));
  if (first + 4 < n) half[1] = __ldcg(reinterpret_cast<const int4*>(from + first + 4));
#pragma unroll
  for (int h = 0; h < 2; ++h)
    x[4 * h] = half[h].x, x[4 * h + 1] = half[h].y, x[4 * h + 2] = half[h].z, x[4 * h + 3] = half[h].w;
#pragma unroll
  for (int k = 0; k < 8; ++k) x[k] = first + k < n ? x[k] : 0;
}

/// The sums of scan_by_block(). \param to  aligned for int4
__device__ inline void write_numbers(const int (&x)[scanned_at_once], int n, int first, std::int32_t* to) {
  if (first + 8 <= n) {
    *reinterpret_cast<int4*>(to + first) = {x[0], x[1], x[2], x[3]};
    *reinterpret_cast<int4*>(to + first + 4) = {x[4], x[5], x[6], x[7]};
    return;
  }
#pragma unroll
  for (int k = 0; k < 8; ++k)
    if (first + k < n) to[first + k] = x[k];
}

/// One block: where the rows of each landmark and the chunks of each bin begin.
template <class Tuning>
__device__ inline void begin_rows(const observation_work& w) {
  const int bins = w.frames * w.kinds;
  const int rows = scan_by_block<Tuning::scan_threads, int>(
      w.landmarks, [&](int first, int(&x)[8]) { read_numbers(w.row_count, w.landmarks, first, x); },
      [&](int first, const int(&sum)[8]) { write_numbers(sum, w.landmarks, first, w.landmark_row); });
  const int chunks = scan_by_block<Tuning::scan_threads, int>(
      bins,
      [&](int first, int(&x)[8]) {
        read_numbers(w.bin_rows, bins, first, x);
        for (int& count : x) count = (count + observation_padding - 1) / observation_padding;
      },
      [&](int first, const int(&sum)[8]) {
        for (int k = 0; k < 8 && first + k < bins; ++k) {
          w.bin_chunk[first + k] = sum[k];
          if ((first + k) % w.kinds == 0 && (first + k) / w.kinds <= w.free_frames)
            w.frame_partial[(first + k) / w.kinds] = sum[k];
        }
      });
  if (threadIdx.x != 0) return;
  w.landmark_row[w.landmarks] = rows, w.bin_chunk[bins] = chunks, w.report->sizes.chunks = chunks;
  if (w.free_frames == w.frames) w.frame_partial[w.free_frames] = chunks;
}

/// One block: where the slots and couplings of each landmark and the slots of each frame begin, and the sizes of all.
template <class Tuning>
__device__ inline void begin_slots(const observation_work& w) {
  constexpr int threads = Tuning::scan_threads;
  __shared__ std::int64_t pairs_of_warp[threads / warp_size];
  __shared__ int moving_of_warp[threads / warp_size];
  const int thread = static_cast<int>(threadIdx.x);
  std::int64_t pairs = 0;
  int moving = 0;
  const std::int64_t both = scan_by_block<threads, std::int64_t>(  // slots in the upper half, couplings in the lower
      w.landmarks,
      [&](int first, std::int64_t(&x)[8]) {
        int slots[8], couplings[8];
        read_numbers(w.slot_count, w.landmarks, first, slots),
            read_numbers(w.free_count, w.landmarks, first, couplings);
#pragma unroll
        for (int k = 0; k < 8; ++k) {
          const std::int64_t n = slots[k] & ~w.moves;
          pairs += n * (n - 1) / 2, moving += (slots[k] & w.moves) != 0 ? 1 : 0;
          x[k] = n << 32 | couplings[k];
        }
      },
      [&](int first, const std::int64_t(&sum)[8]) {
        int slots[8], couplings[8];
#pragma unroll
        for (int k = 0; k < 8; ++k) slots[k] = static_cast<int>(sum[k] >> 32), couplings[k] = static_cast<int>(sum[k]);
        write_numbers(slots, w.landmarks, first, w.landmark_slot);
        write_numbers(couplings, w.landmarks, first, w.coupling_of);
      });
  const int slots_of_frames = scan_by_block<threads, int>(
      w.free_frames, [&](int first, int(&x)[8]) { read_numbers(w.frame_count, w.free_frames, first, x); },
      [&](int first, const int(&sum)[8]) { write_numbers(sum, w.free_frames, first, w.frame_slot); });
  pairs = sum_lanes<warp_size>(pairs), moving = sum_lanes<warp_size>(moving);
  if (thread % warp_size == 0) pairs_of_warp[thread / warp_size] = pairs, moving_of_warp[thread / warp_size] = moving;
  __syncthreads();
  if (thread != 0) return;
  for (int i = 1; i < threads / warp_size; ++i) pairs += pairs_of_warp[i], moving += moving_of_warp[i];
  const int slots = static_cast<int>(both >> 32), couplings = static_cast<int>(both);
  w.landmark_slot[w.landmarks] = slots, w.coupling_of[w.landmarks] = couplings;
  w.frame_slot[w.free_frames] = slots_of_frames, w.slot_coupling[slots] = couplings;
  structure_sizes& sizes = w.report->sizes;
  sizes.rows = w.rows, sizes.couplings = couplings, sizes.slots = slots, sizes.pairs = pairs, sizes.moving = moving;
  sizes.free_chunks = w.frame_partial[w.free_frames];
}

}  // namespace detail

/// A thread per row of the input: counts it. The last block goes on alone.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads, 1) count_rows_kernel(observation_work w) {
  const int i = static_cast<int>(blockIdx.x) * Tuning::scan_threads + static_cast<int>(threadIdx.x);
  if (i < w.rows) {
    w.place[i] = atomicAdd(w.row_count + w.landmark[i], 1);
    atomicAdd(w.bin_rows + w.key_of_frame[w.frame[i]] * w.kinds + w.kind[i], 1);
  }
  if (is_last_block(w.arrived)) detail::begin_rows<Tuning>(w);
}

/// A thread per row of the input: puts it beside those of its landmark.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::threads) gather_rows_kernel(observation_work w) {
  begin_early();
  const int i = static_cast<int>(blockIdx.x) * Tuning::threads + static_cast<int>(threadIdx.x);
  if (i >= w.rows) return;
  w.mixed[w.landmark_row[w.landmark[i]] + w.place[i]] =
      static_cast<std::uint64_t>(w.key_of_frame[w.frame[i]]) << 32 | static_cast<unsigned>(i);
}

namespace detail {

/// The lanes of a warp: the rows of a landmark in their order, and how many slots and couplings they make.
template <class Tuning>
__device__ inline void sort_rows(const observation_work& w, int l, int lane) {
  const int begin = w.landmark_row[l], count = w.landmark_row[l + 1] - begin;
  if (count > Tuning::most_rows) {
    if (lane == 0) w.report->too_long = 1, w.slot_count[l] = w.free_count[l] = 0;
    return;
  }
  int slots = 0, couplings = 0;
  for (int i = lane; i < count; i += warp_size) {
    const std::uint64_t row = w.mixed[begin + i];
    const int key = w.key_of(row);
    int before = 0;
    bool first = key < w.free_frames;
    couplings += first ? 1 : 0;
    for (int k = 0; k < count; ++k) {
      const std::uint64_t other = w.mixed[begin + k];
      before += other < row ? 1 : 0;
      first = first && !(other < row && w.key_of(other) == key);
    }
    w.ordered[begin + before] = row;
    slots += first ? 1 : 0;
    if (first) atomicAdd(w.frame_count + key, 1);
  }
  slots = sum_lanes<warp_size>(slots), couplings = sum_lanes<warp_size>(couplings);
  if (lane != 0) return;
  w.slot_count[l] = slots + (count > 0 && (w.fixed == nullptr || w.fixed[l] == 0) ? w.moves : 0);
  w.free_count[l] = couplings;
}

}  // namespace detail

/// A warp per landmark: its rows in their order. The last block goes on alone.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads) sort_rows_kernel(observation_work w) {
  begin_early();
  constexpr int warps = Tuning::scan_threads / warp_size;
  const int l = static_cast<int>(blockIdx.x) * warps + static_cast<int>(threadIdx.x) / warp_size;
  if (l < w.landmarks) detail::sort_rows<Tuning>(w, l, static_cast<int>(threadIdx.x) % warp_size);
  if (is_last_block(w.arrived + 1)) detail::begin_slots<Tuning>(w);
}

/// A warp per landmark: its slots, and the couplings of its rows.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::threads) list_slots_kernel(observation_work w) {
  begin_early();
  const int l = (static_cast<int>(blockIdx.x) * Tuning::threads + static_cast<int>(threadIdx.x)) / warp_size;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  if (l >= w.landmarks || w.report->too_long != 0) return;
  const int begin = w.landmark_row[l], count = w.landmark_row[l + 1] - begin;
  int slot = w.landmark_slot[l];
  for (int i = lane; i - lane < count; i += warp_size) {
    const std::uint64_t row = i < count ? w.ordered[begin + i] : 0;
    const int key = i < count ? w.key_of(row) : w.free_frames;
    const bool free = key < w.free_frames;
    const bool first = free && (i == 0 || w.key_of(w.ordered[begin + i - 1]) != key);
    const unsigned firsts = __ballot_sync(whole_warp, first);
    if (first) {
      const int at = slot + __popc(firsts & ((1U << lane) - 1));
      w.slot_coupling[at] = w.coupling_of[l] + i, w.slot_frame[at] = key, w.slot_landmark[at] = l;
    }
    slot += __popc(firsts);
    if (i >= count) continue;
    w.row_bin[begin + i] = key * w.kinds + w.kind[w.source_of(row)];
    w.row_coupling[begin + i] = free ? w.coupling_of[l] + i : -1;
  }
}

TURBOMAP_END_NAMESPACE
