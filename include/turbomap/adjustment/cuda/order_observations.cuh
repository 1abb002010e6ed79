// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_order_observations() under a CUDA policy: the memory of its kernels, and their launches.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../parallel.hpp"
#include "../order_observations.hpp"
#include "list_entries.cuh"
#include "sort_observations.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether there are rows, and not so many bins that going through all rows for each takes longer than the host's sorting.
template <class Derived>
bool can_order_observations(const thrust::cuda_cub::execution_policy<Derived>&, const observation_input& in) {
  const std::int64_t looks = static_cast<std::int64_t>(in.bins() + in.free_frames) * in.rows;
  return in.rows > 0 && looks <= order_observations_tuning::most_looks;
}

template <class Derived, class Arena>
observation_report* launch_order_observations(const thrust::cuda_cub::execution_policy<Derived>& policy, Arena& scratch,
                                              const observation_input& in, const observation_lists& to) {
  using tuning = order_observations_tuning;
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  observation_work w{in, to, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  // What is counted, cleared at once with the report. Each list may be read some numbers beyond its end.
  const auto whole = [&](int n) { return align_up(at(n) * sizeof(std::int32_t)); };
  const std::size_t zeros = align_up(sizeof(observation_report)) + 3 * whole(in.landmarks) + whole(in.bins()) +
                            whole(in.free_frames) + 2 * sizeof(unsigned);
  auto* const cleared = scratch.template take<std::byte>(zeros);
  std::byte* next = cleared + align_up(sizeof(observation_report));
  const auto list = [&](int n) {
    auto* const begin = reinterpret_cast<std::int32_t*>(next);
    next += whole(n);
    return begin;
  };
  w.report = reinterpret_cast<observation_report*>(cleared);
  w.row_count = list(in.landmarks), w.slot_count = list(in.landmarks), w.free_count = list(in.landmarks);
  w.bin_rows = list(in.bins()), w.frame_count = list(in.free_frames);
  w.arrived = reinterpret_cast<unsigned*>(next);
  w.bin_chunk = scratch.template take<std::int32_t>(at(in.bins()) + 1);
  w.coupling_of = scratch.template take<std::int32_t>(at(in.landmarks) + 1);
  w.place = scratch.template take<std::int32_t>(at(in.rows));
  w.mixed = scratch.template take<std::uint64_t>(at(in.rows));
  w.ordered = scratch.template take<std::uint64_t>(at(in.rows));
  w.row_bin = scratch.template take<std::int32_t>(at(in.rows));
  w.row_coupling = scratch.template take<std::int32_t>(at(in.rows));

  fill_bytes(policy, cleared, 0, zeros);
  const auto blocks = [](int n, int each) { return (n + each - 1) / each; };
  constexpr int landmarks = tuning::threads / warp_size, more_landmarks = tuning::scan_threads / warp_size;
  launch_kernel(policy, "launch of count_rows", count_rows_kernel<tuning>, blocks(in.rows, tuning::scan_threads),
                tuning::scan_threads, w);
  launch_early(policy, "launch of gather_rows", 0, gather_rows_kernel<tuning>, blocks(in.rows, tuning::threads),
               tuning::threads, w);
  launch_early(policy, "launch of sort_rows", 0, sort_rows_kernel<tuning>, blocks(in.landmarks, more_landmarks),
               tuning::scan_threads, w);
  launch_early(policy, "launch of list_slots", 0, list_slots_kernel<tuning>, blocks(in.landmarks, landmarks),
               tuning::threads, w);
  launch_early(policy, "launch of list_entries", 0, list_entries_kernel<tuning>, in.bins() + in.free_frames,
               tuning::bin_threads, w);
  return w.report;
}

TURBOMAP_END_NAMESPACE
