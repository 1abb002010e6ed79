// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The medoid of the descriptors of one point by one thread block: the same answer as medoid_without_memory(). A warp takes
/// every warps-th row of distances, a lane every 32nd of a row; medians are found by counting votes of the lanes.

#include <cstdint>
#include <limits>
#include <type_traits>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../descriptor/binary.hpp"
#include "../../descriptor/real.hpp"
#include "../medoid.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Whether a block copies descriptors into its shared memory, where rows begin at any multiple of 4 bytes: the library's own.
/// The distance of the user's may read more at once, so theirs are compared where they are.
template <class Descriptor>
struct is_staged : std::false_type {};
template <int Bits>
struct is_staged<binary_descriptor<Bits>> : std::true_type {};
template <class Storage, int Length>
struct is_staged<real_descriptor<Storage, Length>> : std::true_type {};

/// Descriptors in shared memory. Rows of an odd number of words: lanes that read the same word of theirs do not collide.
template <class Descriptor>
struct shared_descriptors {
  static constexpr int stride = (((Descriptor::bytes + 3) / 4) | 1) * 4;
  static constexpr int room = is_staged<Descriptor>::value ? appearance_tuning::descriptor_bytes / stride : 0;
  static constexpr int capacity = room < appearance_tuning::views ? room : appearance_tuning::views;
  static_assert(capacity == 0 || alignof(typename Descriptor::element) <= 4);
  const unsigned char* data;

  __device__ const typename Descriptor::element* operator()(int j) const {
    return reinterpret_cast<const typename Descriptor::element*>(data + j * stride);
  }
};

/// The best row of a warp, or of all.
template <class Key>
struct medoid_row {
  Key median;
  int row;
  __device__ bool wins(const medoid_row& b) const { return median < b.median || (median == b.median && row < b.row); }
};

/// Distances from row i to all n, of which a lane has every 32nd; with a `table`, computed once.
template <class Key, class Keys>
struct warp_distances {
  Keys keys;
  Key* table;  ///< of the warp; null: none
  int n, lane;

  __device__ Key at(int j) const { return table != nullptr ? table[j] : keys(j); }
  __device__ void compute() const {
    if (table == nullptr) return;
    for (int j = lane; j < n; j += warp_size) table[j] = keys(j);  // read by the same lane only
  }
  __device__ int count(Key bound) const {
    int inside = 0;
    for (int j = lane; j - lane < n; j += warp_size)
      inside += __popc(__ballot_sync(whole_warp, j < n && at(j) <= bound));
    return inside;
  }
  /// Least and largest key within the bound.
  __device__ key_range<Key> range(Key bound) const {
    key_range<Key> r{0, std::numeric_limits<Key>::max(), std::numeric_limits<Key>::lowest()};
    for (int j = lane; j < n; j += warp_size) {
      const Key key = at(j);
      if (!(key <= bound)) continue;
      r.least = key < r.least ? key : r.least;
      r.most = key > r.most ? key : r.most;
    }
    for (int d = warp_size / 2; d > 0; d /= 2) {
      const Key least = __shfl_xor_sync(whole_warp, r.least, d), most = __shfl_xor_sync(whole_warp, r.most, d);
      r.least = least < r.least ? least : r.least;
      r.most = most > r.most ? most : r.most;
    }
    return r;
  }
};

/// least_median() of the rows that one warp takes.
template <class Key, class Descriptor, class Descriptors>
__device__ inline medoid_row<Key> least_median_of_warp(int n, const Descriptors& descriptors, Key* table) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size, warp = static_cast<int>(threadIdx.x) / warp_size;
  const int needed = (n - 1) / 2 + 1;
  Key bound = std::numeric_limits<Key>::max() - 1;
  medoid_row<Key> best{std::numeric_limits<Key>::max(), 0};
  for (int i = warp; i < n; i += appearance_tuning::warps) {
    using keys = row_keys<Descriptor, Descriptors>;
    const warp_distances<Key, keys> row{keys{descriptors, i}, table, n, lane};
    row.compute();
    if (row.count(bound) < needed) continue;
    const key_range<Key> r = row.range(bound);
    const Key low = median_key(row, r, needed);
    best = {low, i};
    if (low == std::numeric_limits<Key>::lowest()) break;
    bound = low - 1;
  }
  return best;
}

}  // namespace detail

/// The medoid of descriptors(0) ... descriptors(n - 1), n >= 1, in all threads of a block of appearance_tuning::warps warps.
template <class Descriptor, class Descriptors>
__device__ inline int medoid_of_block(int n, const Descriptors& descriptors) {
  using key = detail::distance_key<typename Descriptor::distance_type>;
  using shared = detail::shared_descriptors<Descriptor>;
  using word = std::uint32_t;
  constexpr int warps = appearance_tuning::warps;
  __shared__ word data[shared::capacity > 0 ? shared::capacity * shared::stride / 4 : 1];
  __shared__ key table[warps][appearance_tuning::views];
  __shared__ detail::medoid_row<key> of_warp[warps];
  if (n <= 2) return 0;  // the median of one or two distances is that to itself
  const int thread = static_cast<int>(threadIdx.x), warp = thread / warp_size;
  detail::medoid_row<key> best;
  if (n <= shared::capacity) {
    constexpr int elements = Descriptor::elements;
    for (int k = thread; k < n * elements; k += warps * warp_size) {
      const int j = k / elements, e = k % elements;
      const shared to{reinterpret_cast<const unsigned char*>(data)};
      const_cast<typename Descriptor::element*>(to(j))[e] = descriptors(j)[e];
    }
    __syncthreads();
    const shared staged{reinterpret_cast<const unsigned char*>(data)};
    best = detail::least_median_of_warp<key, Descriptor>(n, staged, table[warp]);
  } else {
    best = detail::least_median_of_warp<key, Descriptor>(n, descriptors,
                                                         n <= appearance_tuning::views ? table[warp] : nullptr);
  }
  if (thread % warp_size == 0) of_warp[warp] = best;
  __syncthreads();
  for (int w = 0; w < warps; ++w)
    if (of_warp[w].wins(best)) best = of_warp[w];
  return best.row;
}

TURBOMAP_END_NAMESPACE
