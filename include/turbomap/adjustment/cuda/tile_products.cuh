// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Products of square tiles of doubles by one warp, with the matrix instructions that devices have from compute capability 8.0
/// on (8 by 8 by 4; from 9.0 on 16 by 8 by 16, which do as much in less time), else with shuffles in their place. A lane of such
/// an instruction has one element of each factor and two of the product; which rows of a tile these are is free, and chosen so
/// that no two lanes meet in a bank of shared memory.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline constexpr int tile_width = 16;

/// A tile in shared memory, in the order of tile_fragment: what a lane needs of it are four pairs, of rows r and r + 8, at
/// constant distances. Rows and columns are mixed so that a row, a column and a fragment are in different banks each.
struct shared_tile {
  double* data;  ///< at a multiple of 16 bytes

  __device__ double* at(int row, int column) const { return data + (of_row(row) ^ of_column(column)); }
  __device__ double load(int row, int column) const { return *at(row, column); }
  __device__ void store(int row, int column, double x) const { *at(row, column) = x; }
  /// Of rows `row` < 8 and row + 8, and of column 4 k + column, column < 4.
  __device__ double2 load_pair(int row, int column, int k) const { return *pair(row, column, k); }
  __device__ void store_pair(int row, int column, int k, double2 x) const { *pair(row, column, k) = x; }

 private:
  __device__ static int of_row(int row) { return (row & 3) * 18 | (row & 4) * 2 | row >> 3; }
  __device__ static int of_column(int column) { return (column & 7) * 2 | (column >> 2) * 64; }
  __device__ double2* pair(int row, int column, int k) const {
    return reinterpret_cast<double2*>(data + ((of_row(row) ^ of_column(column)) ^ k % 2 * 8) + k * 64);
  }
};

/// A tile where it lies in device memory, column by column of `stride` numbers. What is above the diagonal or beyond the matrix
/// reads as 0; what is beyond the matrix is not written.
struct resident_tile {
  double* data;
  int stride, rows, columns;  ///< those that are left of the matrix
  bool diagonal;

  __device__ double2 load_pair(int row, int column, int k) const {
    return make_double2(load(row, column + 4 * k), load(row + 8, column + 4 * k));
  }
  __device__ void store_pair(int row, int column, int k, double2 x) const {
    store(row, column + 4 * k, x.x);
    store(row + 8, column + 4 * k, x.y);
  }
  __device__ double load(int row, int column) const {
    const bool there = row < rows && column < columns && (row >= column || !diagonal);
    return there ? data[static_cast<std::ptrdiff_t>(column) * stride + row] : 0;
  }
  __device__ void store(int row, int column, double x) const {
    if (row < rows && column < columns) data[static_cast<std::ptrdiff_t>(column) * stride + row] = x;
  }
};

/// c += A B^T of 8 by 4 and 8 by 4 numbers: lane l has elements (l / 4, l % 4) of both, and (l / 4, 2 (l % 4)) of c and the one
/// after it.
__device__ inline void multiply_fragments(double a, double b, double (&c)[2]) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
  asm("mma.sync.aligned.m8n8k4.row.col.f64.f64.f64.f64 {%0, %1}, {%2}, {%3}, {%0, %1};"
      : "+d"(c[0]), "+d"(c[1])
      : "d"(a), "d"(b));
#else
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
#pragma unroll 1
  for (int k = 0; k < 4; ++k) {
    const double x = __shfl_sync(whole_warp, a, lane / 4 * 4 + k);
    c[0] = fma(x, __shfl_sync(whole_warp, b, lane % 4 * 8 + k), c[0]);
    c[1] = fma(x, __shfl_sync(whole_warp, b, lane % 4 * 8 + 4 + k), c[1]);
  }
#endif
}

/// What a lane needs of a tile that is a factor of a product. The fragments' row m is row m / 2 + 4 (m % 2) of a tile.
struct tile_fragment {
  static constexpr int steps = tile_width / 4;
  double x[steps][2];  ///< [four columns][half of the rows]

  __device__ tile_fragment() = default;
  __device__ explicit tile_fragment(const shared_tile& from) {
#pragma unroll
    for (int k = 0; k < steps; ++k) {
      const double2 pair = from.load_pair(row(), column(), k);
      x[k][0] = pair.x, x[k][1] = pair.y;
    }
  }
  __device__ static int row() { return static_cast<int>(threadIdx.x) % warp_size / 8 + 4 * (threadIdx.x / 4 % 2); }
  __device__ static int column() { return static_cast<int>(threadIdx.x) % 4; }
};

/// A product of tiles, of 16 by 16, as a warp has it. Columns 2 i and 2 i + 1 of the instructions' fragments are columns i and i + 4
/// of a tile: so each lane has of a product the same elements as of a factor.
class tile_product {
 public:
  /// Adds A B^T.
  __device__ void add(const tile_fragment& a, const tile_fragment& b) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
#pragma unroll
    for (int w = 0; w < 2; ++w)
      asm("mma.sync.aligned.m16n8k16.row.col.f64.f64.f64.f64 {%0, %1, %2, %3}, {%4, %5, %6, %7, %8, %9, %10, %11}, "
          "{%12, %13, %14, %15}, {%0, %1, %2, %3};"
          : "+d"(c_[0][w][0]), "+d"(c_[0][w][1]), "+d"(c_[1][w][0]), "+d"(c_[1][w][1])
          : "d"(a.x[0][0]), "d"(a.x[0][1]), "d"(a.x[1][0]), "d"(a.x[1][1]), "d"(a.x[2][0]), "d"(a.x[2][1]),
            "d"(a.x[3][0]), "d"(a.x[3][1]), "d"(b.x[0][w]), "d"(b.x[1][w]), "d"(b.x[2][w]), "d"(b.x[3][w]));
#else
#pragma unroll
    for (int k = 0; k < tile_fragment::steps; ++k)
#pragma unroll
      for (int i = 0; i < 4; ++i) multiply_fragments(a.x[k][i / 2], b.x[k][i % 2], c_[i / 2][i % 2]);
#endif
  }
  /// The product as a factor.
  __device__ tile_fragment fragment() const {
    tile_fragment f;
#pragma unroll
    for (int k = 0; k < tile_fragment::steps; ++k)
#pragma unroll
      for (int h = 0; h < 2; ++h) f.x[k][h] = c_[h][k / 2][k % 2];
    return f;
  }
  template <class Tile>
  __device__ void store(const Tile& to) const {
#pragma unroll
    for (int k = 0; k < tile_fragment::steps; ++k)
      to.store_pair(tile_fragment::row(), tile_fragment::column(), k,
                    make_double2(c_[0][k / 2][k % 2], c_[1][k / 2][k % 2]));
  }
  /// c <- c less the product.
  template <class Tile>
  __device__ void subtract_from(const Tile& c) const {
    double2 left[tile_fragment::steps];
#pragma unroll
    for (int k = 0; k < tile_fragment::steps; ++k)
      left[k] = c.load_pair(tile_fragment::row(), tile_fragment::column(), k);
#pragma unroll
    for (int k = 0; k < tile_fragment::steps; ++k)
      c.store_pair(tile_fragment::row(), tile_fragment::column(), k,
                   make_double2(left[k].x - c_[0][k / 2][k % 2], left[k].y - c_[1][k / 2][k % 2]));
  }

 private:
  double c_[2][2][2] = {};  ///< [half of the rows][half of the columns]
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
