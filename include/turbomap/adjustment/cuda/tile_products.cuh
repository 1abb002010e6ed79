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

/// A tile in shared memory, row by row. Columns are mixed, in each row otherwise: the elements that lanes ask for together
/// (a column of all rows; four rows of one fragment, four columns each; a row) lie in different banks.
struct shared_tile {
  double* data;

  __device__ double load(int row, int column) const { return data[at(row, column)]; }
  __device__ void store(int row, int column, double x) const { data[at(row, column)] = x; }

 private:
  __device__ static int at(int row, int column) {
    const int mixed = (row & 4) | ((row & 1) << 3) | ((row >> 1) & 1) | ((row >> 2) & 2);
    return row * tile_width + (column ^ mixed);
  }
};

/// A tile of the lower triangle of a matrix in device memory, column by column of `stride` numbers. What is above the diagonal
/// reads as 0, what is beyond the matrix as an identity.
struct resident_tile {
  double* data;
  int stride, rows, columns;  ///< those that are left of the matrix
  bool diagonal;

  __device__ double load(int row, int column) const {
    if (row < rows && column < columns && (row >= column || !diagonal))
      return data[static_cast<std::ptrdiff_t>(column) * stride + row];
    return diagonal && row == column ? 1 : 0;
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

/// The part of a tile of 16 by 16 that a lane has of a product. The fragments' row m is row m / 2 + 4 (m % 2) of a tile, so that
/// their columns 2 i and 2 i + 1 are columns i and i + 4.
class tile_product {
 public:
  __device__ tile_product() : lane_(static_cast<int>(threadIdx.x) % warp_size) {}

  template <class Tile>
  __device__ void load(const Tile& from) {
    for_each([&](int row, int column, double& x) { x = from.load(row, column); });
  }
  template <class Tile>
  __device__ void store(const Tile& to) {
    for_each([&](int row, int column, double& x) { to.store(row, column, x); });
  }
  /// Adds sign A B^T.
  template <class A, class B>
  __device__ void add(const A& first, const B& second, double sign) {
    constexpr int steps = tile_width / 4;
    double a[steps][2], b[steps][2];
#pragma unroll
    for (int k = 0; k < steps; ++k)
#pragma unroll
      for (int h = 0; h < 2; ++h) {
        a[k][h] = sign * first.load(8 * h + row(), 4 * k + lane_ % 4);
        b[k][h] = second.load(8 * h + row(), 4 * k + lane_ % 4);
      }
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
#pragma unroll
    for (int w = 0; w < 2; ++w)
      asm("mma.sync.aligned.m16n8k16.row.col.f64.f64.f64.f64 {%0, %1, %2, %3}, {%4, %5, %6, %7, %8, %9, %10, %11}, "
          "{%12, %13, %14, %15}, {%0, %1, %2, %3};"
          : "+d"(c_[0][w][0]), "+d"(c_[0][w][1]), "+d"(c_[1][w][0]), "+d"(c_[1][w][1])
          : "d"(a[0][0]), "d"(a[0][1]), "d"(a[1][0]), "d"(a[1][1]), "d"(a[2][0]), "d"(a[2][1]), "d"(a[3][0]),
            "d"(a[3][1]), "d"(b[0][w]), "d"(b[1][w]), "d"(b[2][w]), "d"(b[3][w]));
#else
#pragma unroll
    for (int k = 0; k < steps; ++k)
#pragma unroll
      for (int i = 0; i < 4; ++i) multiply_fragments(a[k][i / 2], b[k][i % 2], c_[i / 2][i % 2]);
#endif
  }

 private:
  __device__ int row() const { return lane_ / 8 + 4 * (lane_ / 4 % 2); }

  template <class Function>
  __device__ void for_each(const Function& f) {
#pragma unroll
    for (int i = 0; i < 8; ++i)
      f(8 * (i / 4) + row(), 8 * (i / 2 % 2) + lane_ % 4 + 4 * (i % 2), c_[i / 4][i / 2 % 2][i % 2]);
  }

  int lane_;
  double c_[2][2][2] = {};  ///< [half of the rows][half of the columns]
};

/// One warp: c <- c - a b^T.
template <class Tile>
__device__ inline void subtract_tiles(const Tile& c, const Tile& a, const Tile& b) {
  tile_product p;
  p.load(c);
  p.add(a, b, -1);
  p.store(c);
  __syncwarp();
}

/// One warp: a <- a times the transpose of `inverse`.
template <class Tile>
__device__ inline void divide_tile(const Tile& a, const Tile& inverse) {
  tile_product p;
  p.add(a, inverse, 1);
  __syncwarp();
  p.store(a);
  __syncwarp();
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
