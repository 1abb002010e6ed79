// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_order_observations() under a CUDA policy. Rows are counted per landmark and put beside those of the same one, in any
/// order; a warp per landmark then sorts its few rows by (frame, place in the input), which is one order only. The lists of a
/// frame are made by a block that goes through all rows and keeps its own, in their order.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/block_scan.cuh"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../order_observations.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What the kernels work on.
struct observation_work : observation_input, observation_lists {
  observation_report* report;  ///< where the policy computes
  std::int32_t* bin_rows;      ///< [frame by its key, kind] rows, counted
  std::int32_t* bin_chunk;     ///< [+ 1] its first chunk
  std::int32_t* row_count;     ///< [landmark]
  std::int32_t* slot_count;    ///< [landmark]
  std::int32_t* free_count;    ///< [landmark] couplings
  std::int32_t* frame_count;   ///< [free frame] slots
  std::int32_t* coupling_of;   ///< [landmark + 1] its first one
  std::int32_t* place;         ///< [row of the input] among those of its landmark, in any order
  std::uint64_t* mixed;        ///< [row] (key of the frame, row of the input), in any order within a landmark
  std::uint64_t* ordered;      ///< [row] the same in their order
  std::int32_t* row_bin;       ///< [row]
  std::int32_t* row_coupling;  ///< [row] -1: of a fixed frame

  /// Of an element of `mixed`: the key of its frame.
  __device__ static int key_of(std::uint64_t row) { return static_cast<int>(row >> 32); }
  /// The row of the input.
  __device__ static int source_of(std::uint64_t row) { return static_cast<int>(row & 0xffffffffU); }
};

/// Index = row of the input.
struct count_rows {
  observation_work w;  ///< what it works on
  /// Row i.
  __device__ void operator()(int i) const {
    w.place[i] = atomicAdd(w.row_count + w.landmark[i], 1);
    atomicAdd(w.bin_rows + w.key_of_frame[w.frame[i]] * w.kinds + w.kind[i], 1);
  }
};

/// Index = row of the input: puts it beside those of its landmark.
struct gather_rows {
  observation_work w;  ///< what it works on
  /// Row i.
  __device__ void operator()(int i) const {
    w.mixed[w.landmark_row[w.landmark[i]] + w.place[i]] =
        static_cast<std::uint64_t>(w.key_of_frame[w.frame[i]]) << 32 | static_cast<unsigned>(i);
  }
};

namespace detail {

/// Sums before each of n numbers, by one block: write(i, sum of read(k) for k < i) for i <= n. Returns the sum of all.
template <int Threads, class Read, class Write>
__device__ inline int scan_by_block(int n, Read read, Write write) {
  const int thread = static_cast<int>(threadIdx.x), each = (n + Threads - 1) / Threads;
  const int first = thread * each < n ? thread * each : n, last = first + each < n ? first + each : n;
  int own = 0;
  for (int i = first; i < last; ++i) own += read(i);
  int before, all;
  scan_block<Threads>(own, before, all);
  for (int i = first; i < last; ++i) {
    write(i, before);
    before += read(i);
  }
  if (thread == 0) write(n, all);
  return all;
}

}  // namespace detail

/// One block: where the rows of each landmark and the chunks of each bin begin.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads) begin_rows_kernel(observation_work w) {
  detail::scan_by_block<Tuning::scan_threads>(
      w.landmarks, [&](int l) { return w.row_count[l]; }, [&](int l, int sum) { w.landmark_row[l] = sum; });
  const int chunks = detail::scan_by_block<Tuning::scan_threads>(
      w.frames * w.kinds, [&](int b) { return (w.bin_rows[b] + observation_padding - 1) / observation_padding; },
      [&](int b, int sum) {
        w.bin_chunk[b] = sum;
        if (b % w.kinds == 0 && b / w.kinds <= w.free_frames) w.frame_partial[b / w.kinds] = sum;
      });
  if (threadIdx.x == 0) w.report->sizes.chunks = chunks;
}

/// A warp per landmark: its rows in their order, and how many slots and couplings they make.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::threads) sort_rows_kernel(observation_work w) {
  const int l = (static_cast<int>(blockIdx.x) * Tuning::threads + static_cast<int>(threadIdx.x)) / warp_size;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  if (l >= w.landmarks) return;
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
  if (lane == 0) w.slot_count[l] = slots, w.free_count[l] = couplings;
}

/// One block: where the slots and couplings of each landmark and the slots of each frame begin, and the sizes of all.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::scan_threads) begin_slots_kernel(observation_work w) {
  constexpr int threads = Tuning::scan_threads;
  __shared__ std::int64_t pairs_of_warp[threads / warp_size];
  __shared__ int moving_of_warp[threads / warp_size];
  const int thread = static_cast<int>(threadIdx.x);
  const int slots = detail::scan_by_block<threads>(
      w.landmarks, [&](int l) { return w.slot_count[l]; }, [&](int l, int sum) { w.landmark_slot[l] = sum; });
  const int couplings = detail::scan_by_block<threads>(
      w.landmarks, [&](int l) { return w.free_count[l]; }, [&](int l, int sum) { w.coupling_of[l] = sum; });
  detail::scan_by_block<threads>(
      w.free_frames, [&](int f) { return w.frame_count[f]; }, [&](int f, int sum) { w.frame_slot[f] = sum; });
  std::int64_t pairs = 0;
  int moving = 0;
  for (int l = thread; l < w.landmarks; l += threads) {
    const std::int64_t n = w.slot_count[l];
    pairs += n * (n - 1) / 2;
    moving += w.row_count[l] > 0 && (w.fixed == nullptr || w.fixed[l] == 0) ? 1 : 0;
  }
  pairs = sum_lanes<warp_size>(pairs), moving = sum_lanes<warp_size>(moving);
  if (thread % warp_size == 0) pairs_of_warp[thread / warp_size] = pairs, moving_of_warp[thread / warp_size] = moving;
  __syncthreads();
  if (thread != 0) return;
  for (int i = 1; i < threads / warp_size; ++i) pairs += pairs_of_warp[i], moving += moving_of_warp[i];
  w.slot_coupling[slots] = couplings;
  structure_sizes& sizes = w.report->sizes;
  sizes.rows = w.rows, sizes.couplings = couplings, sizes.slots = slots, sizes.pairs = pairs, sizes.moving = moving;
  sizes.free_chunks = w.frame_partial[w.free_frames];
}

/// A warp per landmark: its slots, and the couplings of its rows.
template <class Tuning>
__global__ void __launch_bounds__(Tuning::threads) list_slots_kernel(observation_work w) {
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

namespace detail {

/// Calls take(number of the item, place) for the items of a list that are of one bin, in their order, by one block.
template <int Threads, class Take>
__device__ inline void keep_bin(const std::int32_t* bin_of, int n, int bin, Take take) {
  constexpr int warps = Threads / warp_size, each = 8;
  __shared__ int of_warp[2][warps];
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size, warp = thread / warp_size;
  int before_all = 0, turn = 0;
  for (int base = 0; base < n; base += Threads * each, turn = 1 - turn) {
    const int first = base + thread * each;
    unsigned mine = 0;
#pragma unroll
    for (int k = 0; k < each; ++k)
      if (first + k < n && bin_of[first + k] == bin) mine |= 1U << k;
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
__global__ void __launch_bounds__(Tuning::bin_threads) list_entries_kernel(observation_work w) {
  constexpr int threads = Tuning::bin_threads, padding = observation_padding;
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

/// Whether there are rows, and not so many bins that going through all rows for each takes longer than the host's sorting.
template <class Derived>
bool can_order_observations(const thrust::cuda_cub::execution_policy<Derived>&, const observation_input& in) {
  const std::int64_t looks = static_cast<std::int64_t>(in.bins() + in.free_frames) * in.rows;
  return in.rows > 0 && looks <= order_observations_tuning::most_looks;
}

template <class Derived, class Arena>
void launch_order_observations(const thrust::cuda_cub::execution_policy<Derived>& policy, Arena& scratch,
                               const observation_input& in, const observation_lists& to, observation_report* report) {
  using tuning = order_observations_tuning;
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  observation_work w{in, to, report, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  const std::size_t counts = at(in.bins()) + at(in.landmarks) + at(in.free_frames);
  w.bin_rows = scratch.template take<std::int32_t>(counts);
  w.row_count = w.bin_rows + in.bins(), w.frame_count = w.row_count + in.landmarks;
  w.bin_chunk = scratch.template take<std::int32_t>(at(in.bins()) + 1);
  w.slot_count = scratch.template take<std::int32_t>(at(in.landmarks));
  w.free_count = scratch.template take<std::int32_t>(at(in.landmarks));
  w.coupling_of = scratch.template take<std::int32_t>(at(in.landmarks) + 1);
  w.place = scratch.template take<std::int32_t>(at(in.rows));
  w.mixed = scratch.template take<std::uint64_t>(at(in.rows));
  w.ordered = scratch.template take<std::uint64_t>(at(in.rows));
  w.row_bin = scratch.template take<std::int32_t>(at(in.rows));
  w.row_coupling = scratch.template take<std::int32_t>(at(in.rows));

  fill_bytes(policy, report, 0, sizeof *report);
  fill_bytes(policy, w.bin_rows, 0, counts * sizeof(std::int32_t));
  for_each_index(policy, in.rows, count_rows{w});
  launch_kernel(policy, "launch of begin_rows", begin_rows_kernel<tuning>, 1, tuning::scan_threads, w);
  for_each_index(policy, in.rows, gather_rows{w});
  constexpr int warps = tuning::threads / warp_size;
  const int grid = (in.landmarks + warps - 1) / warps;
  launch_kernel(policy, "launch of sort_rows", sort_rows_kernel<tuning>, grid, tuning::threads, w);
  launch_kernel(policy, "launch of begin_slots", begin_slots_kernel<tuning>, 1, tuning::scan_threads, w);
  launch_kernel(policy, "launch of list_slots", list_slots_kernel<tuning>, grid, tuning::threads, w);
  launch_kernel(policy, "launch of list_entries", list_entries_kernel<tuning>, in.bins() + in.free_frames,
                tuning::bin_threads, w);
}

TURBOMAP_END_NAMESPACE
