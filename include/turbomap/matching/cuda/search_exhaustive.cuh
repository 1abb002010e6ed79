// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_search_exhaustive() under a CUDA policy: a warp takes a few query keypoints and one neighbour, a lane every 32nd
/// candidate. A candidate is read once for all queries of the warp; geometry is looked at only where a distance can still win,
/// by all lanes that have such a candidate at once.

#include <cstdint>
#include <type_traits>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../candidate_scan.hpp"
#include "../exhaustive_search.hpp"
#include "bit_words.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// What a warp has found for one query keypoint; the same in all lanes.
template <class Distance>
struct found_candidate {
  Distance distance;
  std::int32_t keypoint;

  /// The tie rule of candidate_scan.
  __device__ bool wins(const found_candidate& b, tie_rule ties) const {
    if (keypoint == no_match || b.keypoint == no_match) return keypoint != no_match;
    if (distance != b.distance) return distance < b.distance;
    return ties == tie_rule::lowest_index ? keypoint < b.keypoint : keypoint > b.keypoint;
  }
};

/// Takes the best of the lanes' candidates that are consistent. Rare, so it is not worth its registers in the loop.
/// \param candidate  of the lane; no_match: none
template <class Descriptor, class Camera>
__device__ __noinline__ found_candidate<typename Descriptor::distance_type> consider_candidates(
    const search_view<Descriptor, Camera>& search, int n, int keypoint, std::int32_t candidate,
    typename Descriptor::distance_type d, found_candidate<typename Descriptor::distance_type> best) {
  using found = found_candidate<typename Descriptor::distance_type>;
  found mine{d, candidate};
  if (candidate != no_match && !candidate_scan<Descriptor, Camera>(search, n, keypoint).consistent(candidate))
    mine.keypoint = no_match;
  const tie_rule ties = search.options.ties;
  for (int lanes = warp_size / 2; lanes > 0; lanes /= 2) {
    const found other{__shfl_xor_sync(whole_warp, mine.distance, lanes),
                      __shfl_xor_sync(whole_warp, mine.keypoint, lanes)};
    if (other.wins(mine, ties)) mine = other;
  }
  return mine.wins(best, ties) ? mine : best;
}

/// Searches `Queries` slots from `first` in neighbour n. \tparam Kept  how descriptors are kept
template <class Kept, int Queries, class Descriptor, class Camera>
__device__ inline void search_of_warp(const search_view<Descriptor, Camera>& search, int n, int first) {
  using found = found_candidate<typename Descriptor::distance_type>;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int size = search.slot_count - first < Queries ? search.slot_count - first : Queries;
  const auto& neighbour = search.neighbour(n);
  Kept query[Queries];
  found best[Queries];
#pragma unroll
  for (int q = 0; q < Queries; ++q) {
    best[q] = {search.max_distance, no_match};
    query[q] = Kept::load(search.query().descriptor_of(search.queries[first + (q < size ? q : 0)]));
  }
  const int end = search.candidate_offset[n + 1];
  for (int k = search.candidate_offset[n]; k < end; k += warp_size) {
    const bool real = k + lane < end;
    const std::int32_t c = search.candidates[real ? k + lane : end - 1];
    const Kept candidate = Kept::load(neighbour.descriptor_of(c));
#pragma unroll
    for (int q = 0; q < Queries; ++q) {
      const auto d = query[q].distance(candidate);
      const bool hit = real && q < size && d <= best[q].distance;
      if (__any_sync(whole_warp, hit))
        best[q] =
            consider_candidates(search, n, search.queries[first + (q < size ? q : 0)], hit ? c : no_match, d, best[q]);
    }
  }
#pragma unroll
  for (int q = 0; q < Queries; ++q)
    if (lane == q && q < size) {
      const int i = n * search.slot_count + first + q;
      search.match[i] = best[q].keypoint;
      search.distance[i] = best[q].distance;
    }
}

}  // namespace detail

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(warp_size* search_exhaustive_tuning::warps, search_exhaustive_tuning::blocks)
    search_exhaustive_kernel(search_view<Descriptor, Camera> search, int tasks) {
  constexpr int queries = search_exhaustive_tuning::queries;
  const int task =
      static_cast<int>(blockIdx.x) * search_exhaustive_tuning::warps + static_cast<int>(threadIdx.x) / warp_size;
  if (task >= tasks) return;  // whole warps
  const int groups = (search.slot_count + queries - 1) / queries;
  const int n = task / groups, first = task % groups * queries;
  using kept = typename kept_form<Descriptor>::type;
  using any = kept_descriptor<Descriptor>;
  if (std::is_same_v<kept, any> ||
      (kept::fits(search.query().descriptor) && kept::fits(search.neighbour(n).descriptor)))
    detail::search_of_warp<kept, queries>(search, n, first);
  else
    detail::search_of_warp<any, queries>(search, n, first);
}

template <class Derived, class Descriptor, class Camera>
bool launch_search_exhaustive(const thrust::cuda_cub::execution_policy<Derived>& policy,
                              const search_view<Descriptor, Camera>& search) {
  constexpr int warps = search_exhaustive_tuning::warps, queries = search_exhaustive_tuning::queries;
  const int tasks = search.neighbour_count * ((search.slot_count + queries - 1) / queries);
  launch_kernel(policy, "launch of search_exhaustive", search_exhaustive_kernel<Descriptor, Camera>,
                (tasks + warps - 1) / warps, warp_size * warps, search, tasks);
  return true;
}

TURBOMAP_END_NAMESPACE
