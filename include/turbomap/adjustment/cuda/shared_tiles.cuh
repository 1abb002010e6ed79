// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// shared_tiles: the columns of tiles that a block works on at a time, in shared memory, where products find them at once. Only
/// the tiles of a tile_lists are there. A matrix that does not fit is taken in parts: so many of its first columns as there is
/// room for, then the next, until what is left fits.

#include <cuda_pipeline.h>

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "tile_lists.cuh"
#include "tile_products.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A symmetric matrix in device memory: its lower triangle, column by column.
struct resident_matrix {
  double* data;
  int stride;  ///< numbers from a column to the next
  int n;       ///< rows, columns

  __device__ resident_tile tile(int i, int j) const {
    const int row = i * tile_width, column = j * tile_width;
    return {data + static_cast<std::ptrdiff_t>(column) * stride + row, stride, n - row, n - column, i == j};
  }
};

/// Columns [begin, end) of the lower triangle of tiles, one after the other, each from its diagonal down.
class shared_tiles {
 public:
  int begin = 0, end = 0;

  __device__ shared_tiles(double* memory, const tile_lists& lists, int count)
      : memory_(memory), lists_(lists), count_(count) {}

  /// Goes on from `end`: to the last column, or as far as there is room, and no farther than to what fits at a time then.
  __device__ void advance(int room) {
    begin = end;
    const int first = lists_.before[begin], all = lists_.before[count_];
    while (end < count_ && all - lists_.before[end] > room && lists_.before[end + 1] - first <= room) ++end;
    if (end == begin) end = count_;  // nothing was taken: all that is left fits
  }
  /// Goes back from `begin`: so many of the columns before it as there is room for.
  __device__ void retreat(int room) {
    end = begin;
    while (begin > 0 && lists_.before[end] - lists_.before[begin - 1] <= room) --begin;
  }
  /// Of row i and column j, begin <= j < end.
  __device__ shared_tile tile(int i, int j) const {
    const int above = i == j ? 0 : 1 + __popc(lists_.below[j] & ((1U << i) - 1));
    return at(lists_.before[j] - lists_.before[begin] + above);
  }
  /// On the diagonal of the first column: known before the lists are.
  __device__ shared_tile first_tile() const { return at(0); }

  /// One warp begins to copy a tile there, see __pipeline_commit(). What is above the diagonal becomes 0, what is beyond the
  /// matrix an identity.
  __device__ static void load(const resident_matrix& s, int i, int j, const shared_tile& to) {
    const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % tile_width, c = lane / tile_width;
    const int row = i * tile_width + r;
    const double* const from = s.data + static_cast<std::ptrdiff_t>(j * tile_width + c) * s.stride + row;
    const auto begin_copy = [&](int k) {
      __pipeline_memcpy_async(to.at(r, c + k), from + static_cast<std::ptrdiff_t>(k) * s.stride, sizeof(double));
    };
    if (i > j && (i + 1) * tile_width <= s.n) {
#pragma unroll
      for (int k = 0; k < tile_width; k += 2) begin_copy(k);
    } else {
#pragma unroll 1
      for (int k = 0; k < tile_width; k += 2) {
        const int column = j * tile_width + c + k;
        if (row < s.n && column <= row)
          begin_copy(k);
        else
          to.store(r, c + k, row == column);
      }
    }
  }
  /// One warp begins to copy tile `first` of them and every `step`-th after it: two groups, those of the first `soon` columns and
  /// the rest.
  __device__ void load(const resident_matrix& s, int soon, int first, int step) const {
    bool rest = false;
    lists_.for_each(begin, end, first, step, [&](int i, int j) {
      if (!rest && j >= begin + soon) rest = true, __pipeline_commit();
      load(s, i, j, tile(i, j));
    });
    if (!rest) __pipeline_commit();
    __pipeline_commit();
  }
  /// One warp copies such tiles back to where they lie.
  __device__ void store(const resident_matrix& s, int first, int step) const {
    const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % tile_width;
    lists_.for_each(begin, end, first, step, [&](int i, int j) {
      const shared_tile from = tile(i, j);
      const resident_tile to = s.tile(i, j);
#pragma unroll 2
      for (int k = lane / tile_width; k < tile_width; k += 2) to.store(r, k, from.load(r, k));
    });
  }

 private:
  __device__ shared_tile at(int place) const { return {memory_ + place * (tile_width * tile_width)}; }

  double* memory_;
  const tile_lists& lists_;
  int count_;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
