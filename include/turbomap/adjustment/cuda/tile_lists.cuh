// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// tile_lists: which tiles of a symmetric matrix are worked on when it is factorised: those that are not 0, and those that
/// do not stay so. They are found once, by one warp, and kept as bits: of a column, and of a row. A matrix without zeros has
/// all of its lower triangle.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// In shared memory.
struct tile_lists {
  static constexpr int most = warp_size;  // a lane per column, a bit per row
  unsigned below[most];                   ///< by column of tiles: a bit per row below the diagonal
  unsigned left[most];                    ///< by row of tiles: a bit per column left of the diagonal
  int before[most + 1];           ///< by column: how many tiles the columns before it have, with their diagonals
  unsigned char row[most][most];  ///< the rows of below[column], ascending

  /// Below the diagonal.
  __device__ int count(int column) const { return __popc(below[column]); }
  __device__ bool has(int row, int column) const { return (below[column] >> row & 1) != 0; }
  /// Columns of [begin, end) that both rows have tiles of, a bit each.
  __device__ unsigned common(int i, int j, int begin, int end) const {
    return left[i] & left[j] & ((1U << end) - 1) & ~((1U << begin) - 1);
  }
  /// f(row, column) for tile `first` of columns [begin, end) and every `step`-th after it, column after column from the
  /// diagonal down.
  template <class Function>
  __device__ void for_each(int begin, int end, int first, int step, const Function& f) const {
    int j = begin;
    for (int at = first; j < end; at += step) {
      while (at > count(j)) {
        at -= count(j) + 1;
        if (++j >= end) return;
      }
      f(at == 0 ? j : row[j][at - 1], j);
    }
  }
};

/// One warp makes the lists. \param filled  [column of tiles][row of tiles] not 0: the tile is not; null: all are not
__device__ inline void list_tiles(const int* filled, int count, tile_lists& lists) {
  constexpr int most = tile_lists::most;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  unsigned mine = lane < count ? ((2U << (count - 1)) - 1) & ~((2U << lane) - 1) : 0;
  if (filled != nullptr) {
    unsigned not_zero = 0;
#pragma unroll
    for (int i = 0; i < most; ++i) not_zero |= (mine >> i & 1) != 0 && filled[lane * most + i] != 0 ? 1U << i : 0;
    mine = not_zero;
    for (int p = 0; p < count; ++p) {  // products of column p reach each two of its rows
      const unsigned rows = __shfl_sync(whole_warp, mine, p);
      if (lane > p && (rows >> lane & 1) != 0) mine |= rows & ~((2U << lane) - 1);
    }
  }
  lists.below[lane] = mine;
  for (int i = 0; i < count; ++i) {
    const unsigned columns = __ballot_sync(whole_warp, (mine >> i & 1) != 0);
    if (lane == 0) lists.left[i] = columns;
  }
  lists.before[lane + 1] = sum_up_to_lane(lane < count ? __popc(mine) + 1 : 0);
  if (lane == 0) lists.before[0] = 0;
  for (int k = 0; mine != 0; ++k, mine &= mine - 1) lists.row[lane][k] = static_cast<unsigned char>(__ffs(mine) - 1);
  __syncwarp();
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
