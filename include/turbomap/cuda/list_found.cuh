// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_list_found(): the entries of the indices that found something, one after the other in the order of the indices. Two
/// kernels: each block counts its indices, then each knows from the counts before it where its entries go.

#include <cstddef>
#include <cstdint>
#include <utility>

#include "../array.hpp"
#include "../config.hpp"
#include "../found_list.hpp"
#include "block_scan.cuh"
#include "parallel.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class Found, class Entry>
__global__ void __launch_bounds__(list_found_tuning::threads)
    count_found_kernel(int count, Found found, std::int32_t* of_block) {
  const int i = static_cast<int>(blockIdx.x) * list_found_tuning::threads + static_cast<int>(threadIdx.x);
  Entry entry;
  const int n = __syncthreads_count(i < count && found(i, entry));
  if (threadIdx.x == 0) of_block[blockIdx.x] = n;
}

template <class Found, class Entry>
__global__ void __launch_bounds__(list_found_tuning::threads)
    list_found_kernel(int count, Found found, const std::int32_t* of_block, packed_list<Entry> list) {
  constexpr int threads = list_found_tuning::threads;
  const int block = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  int earlier = 0;
  for (int b = thread; b < block; b += threads) earlier += of_block[b];
  int before, begin;
  scan_block<threads>(earlier, before, begin);
  const int i = block * threads + thread;
  Entry entry;
  const bool has = i < count && found(i, entry);
  int all;
  count_block<threads>(has, before, all);
  if (has) list.entries()[begin + before] = entry;
  if (thread == 0 && blockIdx.x + 1 == gridDim.x) *list.size() = begin + all;
}

}  // namespace detail

/// \param room   of the list and of what it is made with; grows as needed, its content is discarded
template <class Derived, class Found, class Entry = typename Found::entry>
packed_list<Entry> launch_list_found(const thrust::cuda_cub::execution_policy<Derived>& policy, int count,
                                     const Found& found, array<std::byte, device_memory>& room) {
  constexpr int threads = list_found_tuning::threads;
  const int blocks = (count - 1) / threads + 1;
  const std::size_t list_bytes = align_up(packed_list<Entry>::header + static_cast<std::size_t>(count) * sizeof(Entry));
  const std::size_t bytes = list_bytes + static_cast<std::size_t>(blocks) * sizeof(std::int32_t);
  if (bytes > room.capacity()) {
    array<std::byte, device_memory> grown(room.resource());
    grown.resize_discard(bytes);
    // More entries may be copied than there are: their bytes should be known to a memory checker. Where filling fails,
    // the room is as it was, so that the next call fills it.
    fill_bytes(policy, grown.data(), 0, grown.capacity());
    room = std::move(grown);
  }
  const packed_list<Entry> list{room.data()};
  auto* const of_block = reinterpret_cast<std::int32_t*>(room.data() + list_bytes);
  launch_kernel(policy, "launch of count_found", detail::count_found_kernel<Found, Entry>, blocks, threads, count,
                found, of_block);
  launch_kernel(policy, "launch of list_found", detail::list_found_kernel<Found, Entry>, blocks, threads, count, found,
                static_cast<const std::int32_t*>(of_block), list);
  return list;
}

TURBOMAP_END_NAMESPACE
