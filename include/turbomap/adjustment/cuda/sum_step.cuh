// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_sum_step(), launch_survey_frames() under a CUDA policy: one block, in a fixed order, so that the same numbers give
/// the same bits. It writes its report into pinned memory, where the host looks for it while later work runs.

#include <cstddef>
#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../factor_sums.hpp"
#include "../step_sums.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The report, and then that it is there. One thread.
template <class Report>
__device__ inline void hand_over(const Report& report, awaited<Report>* to) {
  to->report = report;
  __threadfence_system();
  *static_cast<volatile std::int32_t*>(&to->ready) = 1;
}

}  // namespace detail

/// Whether a kernel may write a report there: a user's staging memory need not be pinned.
template <class Report>
bool can_hand_over(const awaited<Report>* to) {
  cudaPointerAttributes attributes{};
  check_cuda(cudaPointerGetAttributes(&attributes, to), "look at staging memory");
  return attributes.type == cudaMemoryTypeHost && attributes.devicePointer == to;
}

template <int D>
__global__ void __launch_bounds__(sum_step_tuning::threads) sum_step_kernel(step_parts s, awaited<step_report>* to) {
  begin_early();
  constexpr int threads = sum_step_tuning::threads, warps = threads / warp_size, size = 3;
  constexpr std::size_t triangle = frame_block<D>::triangle;
  __shared__ double of_warp[warps][size];
  const int thread = static_cast<int>(threadIdx.x);
  double x[size] = {};  // cost, undefined, predicted
#pragma unroll 4
  for (std::size_t i = static_cast<std::size_t>(thread); i < s.cost_count; i += threads)
    x[0] += s.costs[i], x[1] += s.costs[s.cost_count + i];
  if (s.gains != nullptr) {
    for (std::size_t i = static_cast<std::size_t>(thread); i < s.gain_count; i += threads) x[2] += s.gains[i];
    for (std::size_t i = static_cast<std::size_t>(thread); i < s.unknowns; i += threads) {
      const double h = s.damping.scaled ? s.H[i / D * triangle + (i % D) * (i % D + 3) / 2] : 0, dx = s.step[i];
      x[2] += dx * (s.damping(h) * dx + s.b[i]);
    }
  }
  for (int i = 0; i < size; ++i) {
    x[i] = sum_lanes<warp_size>(x[i]);
    if (thread % warp_size == 0) of_warp[thread / warp_size][i] = x[i];
  }
  __syncthreads();
  if (thread != 0) return;
  double sum[size] = {};
  for (int w = 0; w < warps; ++w)
    for (int i = 0; i < size; ++i) sum[i] += of_warp[w][i];
  step_report report{sum[0], sum[1], sum[2], s.solved == nullptr ? 1 : *s.solved, NAN};
  if (s.next_lambda != nullptr)
    *s.next_lambda = report.lambda = damping_after(s, report.cost, report.predicted, report.solved);
  detail::hand_over(report, to);
}

template <int D>
__global__ void __launch_bounds__(sum_step_tuning::threads)
    survey_frames_kernel(const double* diagonal, int landmarks, const double* H, int free_frames,
                         const std::uint32_t* held, awaited<survey_report>* to) {
  constexpr int threads = sum_step_tuning::threads, warps = threads / warp_size;
  __shared__ double largest_of_warp[warps], missing_of_warp[warps];
  const int thread = static_cast<int>(threadIdx.x);
  double largest = 0, missing = 0;
  if (diagonal != nullptr)
    for (int l = thread; l < landmarks; l += threads) largest = larger(diagonal[l], largest);
  for (int i = thread; i < free_frames * D; i += threads) {
    const double h = H[static_cast<std::ptrdiff_t>(i / D) * frame_block<D>::triangle + (i % D) * (i % D + 3) / 2];
    missing += h > 0 ? 0 : 1;
    if (held == nullptr || (held[i / D] >> i % D & 1U) == 0) largest = larger(h, largest);
  }
  for (int d = warp_size / 2; d > 0; d /= 2) largest = larger(__shfl_xor_sync(whole_warp, largest, d), largest);
  missing = sum_lanes<warp_size>(missing);
  if (thread % warp_size == 0)
    largest_of_warp[thread / warp_size] = largest, missing_of_warp[thread / warp_size] = missing;
  __syncthreads();
  if (thread != 0) return;
  for (int w = 1; w < warps; ++w) largest = larger(largest_of_warp[w], largest), missing += missing_of_warp[w];
  detail::hand_over(survey_report{largest, missing}, to);
}

template <int D, class Derived>
void launch_sum_step(const thrust::cuda_cub::execution_policy<Derived>& policy, const step_parts& parts,
                     awaited<step_report>* to) {
  to->ready = 0;
  launch_early(policy, "launch of sum_step", 0, sum_step_kernel<D>, 1, sum_step_tuning::threads, parts, to);
}

template <int D, class Derived>
void launch_survey_frames(const thrust::cuda_cub::execution_policy<Derived>& policy, const double* diagonal,
                          int landmarks, const double* H, int free_frames, const std::uint32_t* held,
                          awaited<survey_report>* to) {
  to->ready = 0;
  launch_kernel(policy, "launch of survey_frames", survey_frames_kernel<D>, 1, sum_step_tuning::threads, diagonal,
                landmarks, H, free_frames, held, to);
}

/// Waits until a launched report is there, not for what was enqueued after it.
template <class Derived, class Report>
const Report& wait_for(const thrust::cuda_cub::execution_policy<Derived>& policy, const awaited<Report>& a) {
  constexpr unsigned looks = 4096;  // at the memory, between two at the stream: a failed kernel never writes
  for (unsigned i = 1; __atomic_load_n(&a.ready, __ATOMIC_ACQUIRE) == 0; ++i) {
    if (i % looks != 0) continue;
    const cudaError_t status = cudaStreamQuery(stream_of(policy));
    if (status == cudaErrorNotReady) {
      cudaGetLastError();  // no failure: the next launch must not take it for its own
      continue;
    }
    check_cuda(status, "wait for a step");
    synchronize(policy);
    break;
  }
  return a.report;
}

TURBOMAP_END_NAMESPACE
