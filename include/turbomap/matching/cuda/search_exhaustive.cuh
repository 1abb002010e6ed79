// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_search_exhaustive() under a CUDA policy: a block takes 32 query keypoints and one neighbour. Bits are compared by the
/// tensor cores, 16 queries with 8 candidates at once, each warp with its share of the candidates; without them a warp compares
/// 4 of the queries with all candidates. Geometry is looked at only where a distance can still win, when every lane of a warp has
/// such a pair or nothing is left to compare.

#include <cstdint>
#include <type_traits>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../candidate_scan.hpp"
#include "../exhaustive_search.hpp"
#include "bit_tile.cuh"
#include "bit_words.cuh"
#include "pending_candidates.cuh"
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

/// Whether a pair can see one point. Rare beside distances, so it is not worth its registers in their loops.
template <class Descriptor, class Camera>
__device__ __noinline__ bool consistent_pair(const search_view<Descriptor, Camera>& search, int n, int keypoint,
                                             std::int32_t candidate) {
  return candidate_scan<Descriptor, Camera>(search, n, keypoint).consistent(candidate);
}

/// Searches `Queries` slots from `first` in neighbour n by one warp. \tparam Kept  how descriptors are kept
template <class Kept, int Queries, class Descriptor, class Camera, class Entry>
__device__ inline void search_of_warp(const search_view<Descriptor, Camera>& search, int n, int first, Entry* room) {
  using distance = typename Descriptor::distance_type;
  using found = found_candidate<distance>;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const int size = search.slot_count - first < Queries ? search.slot_count - first : Queries;
  const tie_rule ties = search.options.ties;
  const auto& neighbour = search.neighbour(n);
  const auto keypoint = [&](int q) { return search.queries[first + (q < size ? q : 0)]; };
  pending_candidates<distance, Queries * warp_size> pending(room);
  Kept query[Queries];
  found best[Queries];
#pragma unroll
  for (int q = 0; q < Queries; ++q) {
    best[q] = {search.max_distance, no_match};
    query[q] = Kept::load(search.query().descriptor_of(keypoint(q)));
  }
  const auto judge = [&] {
    Entry mine{};
    const bool good = pending.pop(mine) && consistent_pair(search, n, keypoint(mine.query), mine.candidate);
#pragma unroll
    for (int q = 0; q < Queries; ++q) {
      found of_query{mine.distance, good && mine.query == q ? mine.candidate : no_match};
      if (!__any_sync(whole_warp, of_query.keypoint != no_match)) continue;
      for (int lanes = warp_size / 2; lanes > 0; lanes /= 2) {
        const found other{static_cast<distance>(__shfl_xor_sync(whole_warp, of_query.distance, lanes)),
                          __shfl_xor_sync(whole_warp, of_query.keypoint, lanes)};
        if (other.wins(of_query, ties)) of_query = other;
      }
      if (of_query.wins(best[q], ties)) best[q] = of_query;
    }
  };
  const int end = search.candidate_end[n];
  for (int k = search.candidate_begin[n]; k < end; k += warp_size) {
    const bool real = k + lane < end;
    const std::int32_t c = search.candidates[real ? k + lane : end - 1];
    const Kept candidate = Kept::load(neighbour.descriptor_of(c));
#pragma unroll
    for (int q = 0; q < Queries; ++q) {
      const auto d = query[q].distance(candidate);
      const bool near = real && q < size && d <= best[q].distance;
      if (__any_sync(whole_warp, near)) pending.push(near, {q, c, d});
    }
    while (pending.full()) judge();
  }
  while (!pending.empty()) judge();
#pragma unroll
  for (int q = 0; q < Queries; ++q)
    if (lane == q && q < size) {
      const int i = n * search.slot_count + first + q;
      search.match[i] = best[q].keypoint;
      search.distance[i] = best[q].distance;
    }
}

/// What a block has found for one query keypoint, as a number that is less for what is better: the distance, then the tie
/// rule's order of candidates. No candidate comes after all of the same distance.
struct ranked_candidate {
  using number = unsigned long long;

  __device__ static std::uint32_t place(std::int32_t keypoint, tie_rule ties) {
    return keypoint == no_match
               ? ~std::uint32_t{0}
               : static_cast<std::uint32_t>(ties == tie_rule::lowest_index ? keypoint : INT32_MAX - keypoint);
  }
  __device__ static number rank(std::int32_t distance, std::int32_t keypoint, tie_rule ties) {
    return number{static_cast<std::uint32_t>(distance)} << 32 | place(keypoint, ties);
  }
  __device__ static std::int32_t distance(number r) { return static_cast<std::int32_t>(r >> 32); }
  __device__ static std::int32_t keypoint(number r, tie_rule ties) {
    const auto p = static_cast<std::uint32_t>(r);
    if (p == ~std::uint32_t{0}) return no_match;
    return ties == tie_rule::lowest_index ? static_cast<std::int32_t>(p) : INT32_MAX - static_cast<std::int32_t>(p);
  }
  /// While others change it.
  __device__ static number read(number* r) { return atomicMin(r, ~number{0}); }
};

/// Searches `Queries` slots from `first` in neighbour n by one block, by tensor cores.
/// \param best  shared memory of the block, `Queries` numbers
template <class Tile, int Queries, class Descriptor, class Camera, class Entry>
__device__ inline void search_of_block(const search_view<Descriptor, Camera>& search, int n, int first, Entry* room,
                                       ranked_candidate::number* best) {
  using rank = ranked_candidate;
  constexpr int tiles = Queries / Tile::rows, pairs = Tile::rows * Tile::columns;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, row = lane / 4;
  const tie_rule ties = search.options.ties;
  const auto& neighbour = search.neighbour(n);
  if (static_cast<int>(threadIdx.x) < Queries) best[threadIdx.x] = rank::rank(search.max_distance, no_match, ties);
  __syncthreads();
  typename Tile::part query[2 * tiles];
  std::int32_t bound[2 * tiles];
#pragma unroll
  for (int h = 0; h < 2 * tiles; ++h) {
    const int slot = first + h * Tile::rows / 2 + row;
    const bool real = slot < search.slot_count;
    query[h].load(search.query().descriptor_of(search.queries[real ? slot : first]));
    bound[h] = real ? search.max_distance : -1;
  }
  pending_candidates<std::int32_t, pairs> pending(room);
  const auto judge = [&] {
    Entry mine{};
    if (pending.pop(mine) && mine.distance <= rank::distance(rank::read(best + mine.query))) {
      const std::int32_t c = search.candidates[mine.candidate];
      if (consistent_pair(search, n, search.queries[first + mine.query], c))
        atomicMin(best + mine.query, rank::rank(mine.distance, c, ties));
    }
    __syncwarp();
  };
  const int begin = search.candidate_begin[n], end = search.candidate_end[n];
  const int stride = static_cast<int>(blockDim.x) / warp_size * Tile::columns;
  const auto candidate_at = [&](int k) { return search.candidates[k + row < end ? k + row : end - 1]; };
  int k = begin + static_cast<int>(threadIdx.x) / warp_size * Tile::columns;
  if (k < end) {
    // What the next two turns read is on its way while this one compares.
    typename Tile::part column;
    column.load(neighbour.descriptor_of(candidate_at(k)));
    std::int32_t following = candidate_at(k + stride);
    for (; k < end; k += stride) {
      const typename Tile::part now = column;
      column.load(neighbour.descriptor_of(following));
      following = candidate_at(k + 2 * stride);
      const int first_column = k + 2 * (lane % 4);
#pragma unroll
      for (int t = 0; t < tiles; ++t) {
        std::int32_t d[4];
        Tile::distances(query[2 * t], query[2 * t + 1], now, d);
        bool near[4];
#pragma unroll
        for (int i = 0; i < 4; ++i) near[i] = d[i] <= bound[2 * t + i / 2] && first_column + i % 2 < end;
        if (!__any_sync(whole_warp, near[0] || near[1] || near[2] || near[3])) continue;
#pragma unroll
        for (int i = 0; i < 4; ++i)
          pending.push(near[i], {t * Tile::rows + i / 2 * (Tile::rows / 2) + row, first_column + i % 2, d[i]});
        if (!pending.full()) continue;
        while (pending.full()) judge();
#pragma unroll
        for (int h = 0; h < 2 * tiles; ++h)
          if (bound[h] >= 0) bound[h] = rank::distance(rank::read(best + h * Tile::rows / 2 + row));
      }
    }
    while (!pending.empty()) judge();
  }
  __syncthreads();
  const int q = static_cast<int>(threadIdx.x);
  if (q < Queries && first + q < search.slot_count) {
    const int i = n * search.slot_count + first + q;
    search.match[i] = rank::keypoint(best[q], ties);
    search.distance[i] = rank::distance(best[q]);
  }
}

/// Whether this code was compiled for a device whose tensor cores compare bits.
__device__ constexpr bool has_bit_tiles() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
  return true;
#else
  return false;
#endif
}

}  // namespace detail

template <class Descriptor, class Camera>
__global__ void __launch_bounds__(warp_size* search_exhaustive_tuning::warps, search_exhaustive_tuning::blocks)
    search_exhaustive_kernel(const TURBOMAP_GRID_CONSTANT search_view<Descriptor, Camera> search) {
  constexpr int warps = search_exhaustive_tuning::warps, of_warp = search_exhaustive_tuning::queries;
  constexpr int queries = warps * of_warp;
  using distance = typename Descriptor::distance_type;
  using tile = typename detail::tile_of<Descriptor>::type;
  __shared__ detail::pending_candidate<distance>
      room[warps][detail::pending_candidates<distance, of_warp * warp_size>::capacity];
  const int groups = (search.slot_count + queries - 1) / queries, warp = static_cast<int>(threadIdx.x) / warp_size;
  const int n = static_cast<int>(blockIdx.x) / groups, first = static_cast<int>(blockIdx.x) % groups * queries;
  const auto* a = search.query().descriptor;
  const auto* b = search.neighbour(n).descriptor;
  if constexpr (!std::is_void_v<tile> && detail::has_bit_tiles()) {
    static_assert(tile::rows * tile::columns == of_warp * warp_size, "`room` serves both");
    __shared__ detail::ranked_candidate::number best[queries];
    if (search.options.tensor_cores && tile::fits(a) && tile::fits(b))
      return detail::search_of_block<tile, queries>(search, n, first, room[warp], best);
  }
  using kept = typename kept_form<Descriptor>::type;
  using any = kept_descriptor<Descriptor>;
  const int mine = first + warp * of_warp;
  if (mine >= search.slot_count) return;  // whole warps
  if (std::is_same_v<kept, any> || (kept::fits(a) && kept::fits(b)))
    detail::search_of_warp<kept, of_warp>(search, n, mine, room[warp]);
  else
    detail::search_of_warp<any, of_warp>(search, n, mine, room[warp]);
}

template <class Derived, class Descriptor, class Camera>
bool launch_search_exhaustive(const thrust::cuda_cub::execution_policy<Derived>& policy,
                              const search_view<Descriptor, Camera>& search) {
  constexpr int warps = search_exhaustive_tuning::warps, queries = warps * search_exhaustive_tuning::queries;
  launch_kernel(policy, "launch of search_exhaustive", search_exhaustive_kernel<Descriptor, Camera>,
                search.neighbour_count * ((search.slot_count + queries - 1) / queries), warp_size * warps, search);
  return true;
}

TURBOMAP_END_NAMESPACE
