// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search by projection under a CUDA policy. A block takes some hundred points in one camera: its threads first find those that
/// may have a match, few of them, then share these, so that no thread waits for one that has a decision to make. Where trials are
/// asked for, every point is decided on.

#include <cstdint>

#include "../../config.hpp"
#include "../../context.hpp"
#include "../search_projections.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(search_projections_tuning::threads)
    search_projections_kernel(const TURBOMAP_GRID_CONSTANT projection_view<Descriptor, Camera> search,
                              int points_per_block) {
  constexpr int threads = search_projections_tuning::threads;
  __shared__ std::int32_t hopeful[search_projections_tuning::points];
  __shared__ int count;
  const int blocks = (search.points.count - 1) / points_per_block + 1, thread = static_cast<int>(threadIdx.x);
  const int request = static_cast<int>(blockIdx.x) / blocks;
  const int first = static_cast<int>(blockIdx.x) % blocks * points_per_block;
  const int left = search.points.count - first, last = first + (left < points_per_block ? left : points_per_block);
  const projection_camera& camera = search.cameras[request];
  const std::int64_t at = static_cast<std::int64_t>(request) * search.points.count;
  const projection_search<Descriptor, Camera, 1> body{search};
  if (thread == 0) count = 0;
  __syncthreads();
  const projection_prefilter<Descriptor, Camera> prefilter(search, camera);
  for (int p = first + thread; p < last; p += threads) {
    search.hits[at + p] = {-1, no_match_distance<Descriptor>};
    if (search.trials != nullptr || body.is_hopeful(camera, prefilter, p))
      hopeful[atomicAdd(&count, 1)] = p;  // in any order: points are independent
  }
  __syncthreads();
  const projection_test<Descriptor, Camera> test{search, camera};
  for (int i = thread; i < count; i += threads) {
    const auto trial = test(hopeful[i]);
    if (search.trials != nullptr) search.trials[at + hopeful[i]] = trial;
    body.store(at + hopeful[i], trial);
  }
}

template <class Derived, class Descriptor, class Camera>
void launch_search_projections(const thrust::cuda_cub::execution_policy<Derived>& policy,
                               const projection_view<Descriptor, Camera>& search) {
  using tuning = search_projections_tuning;
  const int points = search.points.count, requests = search.request_count;
  if (points == 0) return;
  const int large = requests * ((points - 1) / tuning::points + 1);
  const int per_block = large < tuning::blocks ? tuning::few : tuning::points;
  launch_kernel(policy, "launch of search_projections", search_projections_kernel<Descriptor, Camera>,
                requests * ((points - 1) / per_block + 1), tuning::threads, search, per_block);
}

TURBOMAP_END_NAMESPACE
