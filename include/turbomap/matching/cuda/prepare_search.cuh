// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_prepare_search() under a CUDA policy: one kernel, whose first blocks list the candidates of a neighbour each while the
/// others compute the geometry of pairs.

#include <cstdint>

#include "../../config.hpp"
#include "../../cuda/block_scan.cuh"
#include "../../parallel.hpp"
#include "../prepare_search.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Lists the candidates of neighbour n by one block, in the order of keypoints.
template <class Descriptor, class Camera>
__device__ inline void list_candidates_of_block(const search_view<Descriptor, Camera>& search, int n) {
  constexpr int threads = prepare_search_tuning::threads;
  const int thread = static_cast<int>(threadIdx.x);
  const std::uint8_t* mapped = search.has_point + search.has_point_offset[n];
  const int keypoints = search.neighbour(n).keypoint_count;
  int end = search.candidate_begin[n];
  for (int first = 0; first < keypoints; first += threads) {
    const int keypoint = first + thread;
    const bool free = keypoint < keypoints && mapped[keypoint] == 0;
    int before, all;
    count_block<threads>(free, before, all);
    if (free) search.candidates[end + before] = keypoint;
    end += all;
  }
  if (thread == 0) search.candidate_end[n] = end;
}

}  // namespace detail

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(prepare_search_tuning::threads)
    prepare_search_kernel(const TURBOMAP_GRID_CONSTANT search_view<Descriptor, Camera> search) {
  const int block = static_cast<int>(blockIdx.x), n = search.neighbour_count;
  if (block < n) return detail::list_candidates_of_block(search, block);
  const int i = (block - n) * prepare_search_tuning::threads + static_cast<int>(threadIdx.x);
  if (i < n * search.query_cameras * search.neighbour_cameras) prepare_pair<Descriptor, Camera>{search}(i);
}

template <class Derived, class Descriptor, class Camera>
void launch_prepare_search(const thrust::cuda_cub::execution_policy<Derived>& policy,
                           const search_view<Descriptor, Camera>& search) {
  constexpr int threads = prepare_search_tuning::threads;
  const int pairs = search.neighbour_count * search.query_cameras * search.neighbour_cameras;
  launch_kernel(policy, "launch of prepare_search", prepare_search_kernel<Descriptor, Camera>,
                search.neighbour_count + (pairs + threads - 1) / threads, threads, search);
}

TURBOMAP_END_NAMESPACE
