// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_solve_dense() under a CUDA policy: Cholesky's method by one thread block, for the systems of local windows. Nothing
/// of the matrix goes to the host. It works on tiles of 16 by 16, right-looking: one warp factorises the tile on the diagonal
/// and inverts the factor; the tiles below are multiplied by the inverse, and their products are subtracted from what is left.
/// One step waits for the next one's tile on the diagonal only, so the first warp factorises that while the others subtract.
/// Frames with an IMU are put into an unknown_order first. Two thirds of the tiles are 0 then and stay so; they are left out.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../solve_dense.hpp"
#include "tile_products.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Where the block keeps the lower triangle of tiles: in shared memory, of devices that have enough of it.
class shared_tiles {
 public:
  static constexpr int width = tile_width;

  __device__ shared_tiles(const dense_equations&, double* memory) : memory_(memory) {}
  static int count(int n) { return (n + width - 1) / width; }
  static std::size_t bytes(int n) {
    return static_cast<std::size_t>(count(n) * (count(n) + 1) / 2) * width * width * sizeof(double);
  }

  /// One warp: tile `first` and every `step`-th after it. What is above the diagonal is 0, what is beyond the matrix an identity.
  __device__ void load(const dense_equations& s, int first, int step) const {
    const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % width;
    const int tiles = (s.n + width - 1) / width;
    for (int i = 0, j = first;; j += step) {
      while (j > i) j -= i + 1, ++i;
      if (i >= tiles) return;
      const shared_tile to = tile(i, j);
      const int row = i * width + r;
      double x[width / 2];
#pragma unroll
      for (int k = 0; k < width / 2; ++k) {
        const int column = j * width + 2 * k + lane / width;
        const bool inside = row < s.n && column <= row;
        x[k] = inside ? s.S[static_cast<std::ptrdiff_t>(column) * s.stride + row] : row == column;
      }
#pragma unroll
      for (int k = 0; k < width / 2; ++k) to.store(r, 2 * k + lane / width, x[k]);
    }
  }
  __device__ shared_tile tile(int i, int j) const { return {memory_ + (i * (i + 1) / 2 + j) * width * width}; }

 private:
  double* memory_;
};

/// Where they are, else.
class resident_tiles {
 public:
  __device__ resident_tiles(const dense_equations& s, double*) : s_(s) {}
  static std::size_t bytes(int) { return 0; }
  __device__ void load(const dense_equations&, int, int) const {}
  __device__ resident_tile tile(int i, int j) const {
    const int row = i * tile_width, column = j * tile_width;
    return {s_.S + static_cast<std::ptrdiff_t>(column) * s_.stride + row, s_.stride, s_.n - row, s_.n - column, i == j};
  }

 private:
  dense_equations s_;
};

/// A reciprocal within two units of the last place, by one step from that of the hardware: a division takes twice as long.
__device__ inline double quick_reciprocal(double x) {
  double y;
  asm("rcp.approx.ftz.f64 %0, %1;" : "=d"(y) : "d"(x));
  const double e = fma(-x, y, 1.0);
  return fma(y, fma(e, e, e), y);
}

/// One warp: replaces a tile on the diagonal, L L^T, by the inverse of L. Lane r has row r, lane 16 + r that of an identity: the
/// steps that divide the rows below by L^T make the inverse of them. What a column waits for is short: its pivot follows from
/// the one before in each lane, and roots are taken of all together, at the end.
/// \return false: a pivot is too small
template <class Tile>
__device__ inline bool invert_factor(const Tile& tile, const double* diagonal, double tolerance) {
  constexpr int width = tile_width;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, row = lane % width;
  double a[width], own = 0;
#pragma unroll
  for (int c = 0; c < width; ++c) a[c] = lane >= width ? c == row : c <= row ? tile.load(row, c) : 0;
  double pivot = __shfl_sync(whole_warp, a[0], 0);
#pragma unroll
  for (int c = 0; c < width; ++c) {
    own = row == c ? pivot : own;
    const double reciprocal = quick_reciprocal(pivot), scaled = a[c] * reciprocal;
    if (c + 1 < width) {
      const double next = __shfl_sync(whole_warp, a[c], c + 1);
      pivot = fma(-(next * next), reciprocal, __shfl_sync(whole_warp, a[c + 1 < width ? c + 1 : c], c + 1));
    }
#pragma unroll
    for (int k = c + 1; k < width; ++k) a[k] -= scaled * __shfl_sync(whole_warp, a[c], k);
  }
  const bool good = own > tolerance * diagonal[row] && own > 0 && is_finite(own);
  const double root = rsqrt(own);
  __syncwarp();  // all have read the tile
#pragma unroll
  for (int c = 0; c < width; ++c) {
    const double x = a[c] * __shfl_sync(whole_warp, root, c);
    if (lane >= width) tile.store(c, row, x);  // transposed; zeros above the diagonal
  }
  __syncwarp();
  return __all_sync(whole_warp, good) != 0;
}

/// One warp: tile times vector. \tparam Transposed  the tile is   \return in lanes r and 16 + r: element r
template <bool Transposed, class Tile>
__device__ inline double multiply_vector(const Tile& tile, const double* x) {
  constexpr int width = tile_width, half = width / 2;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % width, first = lane / width * half;
  double sum[2] = {};
#pragma unroll
  for (int k = 0; k < half; ++k)
    sum[k % 2] += (Transposed ? tile.load(first + k, r) : tile.load(r, first + k)) * x[first + k];
  sum[0] += sum[1];
  return sum[0] + __shfl_xor_sync(whole_warp, sum[0], width);
}

/// One warp: x <- tile x.
template <bool Transposed, class Tile>
__device__ inline void replace_by_product(const Tile& tile, double* x) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const double y = multiply_vector<Transposed>(tile, x);
  __syncwarp();
  if (lane < tile_width) x[lane] = y;
  __syncwarp();
}
/// One warp: y <- y - tile x.
template <bool Transposed, class Tile>
__device__ inline void subtract_product(const Tile& tile, const double* x, double* y) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const double p = multiply_vector<Transposed>(tile, x);
  if (lane < tile_width) y[lane] -= p;
  __syncwarp();
}

/// The tiles below the diagonal that are not 0, or do not stay so.
struct tile_lists {
  static constexpr int most = dense_equations::most_tiles;
  unsigned below[most];           ///< by column of tiles: a bit per row
  unsigned char row[most][most];  ///< the same rows, ascending

  __device__ int count(int column) const { return __popc(below[column]); }
  __device__ bool has(int row, int column) const { return (below[column] >> row & 1) != 0; }
};

/// One warp: what is not 0 at first, and what products of such tiles are subtracted from.
/// \param filled  [column of tiles][row of tiles] not 0: the tile is not; null: all are not
__device__ inline void list_tiles(const int* filled, int count, tile_lists& lists) {
  constexpr int most = tile_lists::most;
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  unsigned mine = 0;
  for (int i = lane + 1; i < count; ++i) mine |= filled == nullptr || filled[lane * most + i] != 0 ? 1U << i : 0;
  for (int p = 0; p < count; ++p) {
    const unsigned rows = __shfl_sync(whole_warp, mine, p);
    if (lane > p && (rows >> lane & 1) != 0) mine |= rows & ~((2U << lane) - 1);
  }
  lists.below[lane] = mine;
  for (int k = 0; mine != 0; ++k, mine &= mine - 1) lists.row[lane][k] = static_cast<unsigned char>(__ffs(mine) - 1);
  __syncwarp();
}

/// Where unknown `at` of an unknown_order is among the unknowns frame by frame.
__device__ inline int unordered(const dense_equations& s, int at) {
  if (s.ordered == nullptr) return at;
  const int D = s.n / s.frames, others = D - s.seen, first = s.frames * others;
  return at < first ? at / others * D + s.seen + at % others : (at - first) / s.seen * D + (at - first) % s.seen;
}

/// What is left of the matrix and of the right hand side after the columns of tile p. \param rows  the tiles below it
/// \param skip  1: all tasks but the first, the next tile on the diagonal   \param worker  of `workers`, a warp each
template <class Tiles>
__device__ inline void subtract_columns(const Tiles& tiles, int p, const unsigned char* rows, int count, int skip,
                                        double* y, int worker, int workers) {
  for (int i = 0, j = skip + worker;; j += workers) {  // row i: i + 1 tiles, then its part of the right hand side
    while (j > i + 1) j -= i + 2, ++i;
    if (i >= count) return;
    const int row = rows[i];
    if (j > i)
      subtract_product<false>(tiles.tile(row, p), y + p * tile_width, y + row * tile_width);
    else
      subtract_tiles(tiles.tile(row, rows[j]), tiles.tile(row, p), tiles.tile(rows[j], p));
  }
}

}  // namespace detail

/// A block per tile of the lower triangle: s.S into s.ordered in an unknown_order, and behind it whether the tile is not 0.
template <int Threads>
__global__ void __launch_bounds__(Threads) order_unknowns_kernel(dense_equations s) {
  constexpr int width = detail::tile_width;
  static_assert(Threads == width * width);
  int i = 0, j = static_cast<int>(blockIdx.x);
  while (j > i) j -= i + 1, ++i;
  const int row = i * width + static_cast<int>(threadIdx.x) % width;
  const int column = j * width + static_cast<int>(threadIdx.x) / width;
  double x = 0;
  if (row < s.n && column <= row) {
    const int a = detail::unordered(s, row), b = detail::unordered(s, column);
    x = s.S[static_cast<std::ptrdiff_t>(a < b ? a : b) * s.stride + (a < b ? b : a)];
    s.ordered[static_cast<std::ptrdiff_t>(column) * s.stride + row] = x;
  }
  const int filled = __syncthreads_or(x != 0);
  int* const all = reinterpret_cast<int*>(s.ordered + static_cast<std::ptrdiff_t>(s.stride) * s.stride);
  if (threadIdx.x == 0) all[j * dense_equations::most_tiles + i] = filled;
}

template <class Tuning, class Tiles>
__global__ void __launch_bounds__(Tuning::threads) solve_dense_kernel(dense_equations s) {
  constexpr int width = detail::tile_width, warps = Tuning::threads / warp_size;
  extern __shared__ double solve_dense_memory[];
  __shared__ int good;
  __shared__ detail::tile_lists lists;
  if (s.lambda != nullptr && isnan(*s.lambda)) return;
  const int* filled = nullptr;
  if (s.ordered != nullptr) {
    s.S = s.ordered;
    filled = reinterpret_cast<const int*>(s.ordered + static_cast<std::ptrdiff_t>(s.stride) * s.stride);
  }
  const int thread = static_cast<int>(threadIdx.x), warp = thread / warp_size;
  const int count = (s.n + width - 1) / width, padded = count * width;
  double* const y = solve_dense_memory;
  double* const diagonal = y + padded;
  const Tiles tiles(s, diagonal + padded);
  for (int i = thread; i < padded; i += Tuning::threads) {
    y[i] = i < s.n ? s.x[detail::unordered(s, i)] : 0;
    diagonal[i] = i < s.n ? s.S[static_cast<std::ptrdiff_t>(i) * s.stride + i] : 1;
  }
  const auto factorise = [&](int p) {
    const bool factorised = detail::invert_factor(tiles.tile(p, p), diagonal + p * width, s.tolerance);
    if (thread == 0) good = factorised ? 1 : 0;
  };
  if (warp == 0) {
    tiles.load(s, 0, count * count);
    __syncwarp();
    factorise(0);
  } else {
    tiles.load(s, warp, warps - 1);
    if (warp == 1) detail::list_tiles(filled, count, lists);
  }
  __syncthreads();
  for (int p = 0; p < count; ++p) {
    if (good == 0) {
      if (thread == 0) *s.solved = 0;
      return;
    }
    const unsigned char* const rows = lists.row[p];
    const int below = lists.count(p), next = lists.has(p + 1, p) ? 1 : 0;  // whether the next diagonal waits for p
    for (int k = warp; k < below; k += warps) detail::divide_tile(tiles.tile(rows[k], p), tiles.tile(p, p));
    if (warp == warps - 1) detail::replace_by_product<false>(tiles.tile(p, p), y + p * width);
    __syncthreads();
    // Warps 4, 8, ... would share the arithmetic of the first one, for which all wait.
    if (warp % 4 != 0)
      detail::subtract_columns(tiles, p, rows, below, next, y, warp - warp / 4 - 1, warps - warps / 4);
    else if (warp == 0 && p + 1 < count) {
      if (next == 1) detail::subtract_tiles(tiles.tile(p + 1, p + 1), tiles.tile(p + 1, p), tiles.tile(p + 1, p));
      factorise(p + 1);
    }
    __syncthreads();
  }
  // L^T x = y, from the last tile on; the first warp has the one that is next.
  if (warp == 0) detail::replace_by_product<true>(tiles.tile(count - 1, count - 1), y + (count - 1) * width);
  __syncthreads();
  for (int p = count - 1; p > 0; --p) {
    for (int q = p - 1 - warp; q >= 0; q -= warps) {
      if (lists.has(p, q)) detail::subtract_product<true>(tiles.tile(p, q), y + p * width, y + q * width);
      if (q == p - 1) detail::replace_by_product<true>(tiles.tile(q, q), y + q * width);
    }
    __syncthreads();
  }
  for (int i = thread; i < s.n; i += Tuning::threads) s.x[detail::unordered(s, i)] = y[i];
  if (thread == 0) *s.solved = 1;
}

namespace detail {

/// False: the device has too little shared memory, and nothing was launched.
template <class Tiles, class Derived>
bool launch_solve_in(const thrust::cuda_cub::execution_policy<Derived>& policy, const dense_equations& s) {
  constexpr int of_kernel = 64 + sizeof(tile_lists);  // bytes of shared memory that are not dynamic
  int device = 0, most = 0;
  check_cuda(cudaGetDevice(&device), "current device");
  check_cuda(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
             "shared memory of a block");
  const std::size_t vectors = 2 * static_cast<std::size_t>(s.n + tile_width) * sizeof(double);
  const std::size_t bytes = vectors + Tiles::bytes(s.n);
  if (bytes > static_cast<std::size_t>(most - of_kernel)) return false;
  const auto kernel = solve_dense_kernel<solve_dense_tuning, Tiles>;
  // The attribute belongs to the kernel, which all contexts share: always the same value.
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, most - of_kernel),
             "shared memory of solve_dense");
  launch_kernel_with(policy, "launch of solve_dense", bytes, kernel, 1, solve_dense_tuning::threads, s);
  return true;
}

}  // namespace detail

template <class Derived>
bool launch_solve_dense(const thrust::cuda_cub::execution_policy<Derived>& policy, const dense_equations& s) {
  static_assert(solve_dense_tuning::unknowns < dense_equations::most_tiles * detail::tile_width);
  if (s.n <= 0 || s.n > solve_dense_tuning::unknowns) return false;
  if (s.ordered != nullptr) {
    constexpr int threads = detail::tile_width * detail::tile_width;
    const int tiles = detail::shared_tiles::count(s.n);
    launch_kernel(policy, "launch of order_unknowns", order_unknowns_kernel<threads>, tiles * (tiles + 1) / 2, threads,
                  s);
  }
  return detail::launch_solve_in<detail::shared_tiles>(policy, s) ||
         detail::launch_solve_in<detail::resident_tiles>(policy, s);
}

TURBOMAP_END_NAMESPACE
