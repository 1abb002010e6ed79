// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_solve_dense() under a CUDA policy: Cholesky's method by one thread block, for the systems of local windows. Nothing
/// of the matrix goes to the host. It works on tiles of 16 by 16, right-looking: one warp factorises the tile on the diagonal
/// and inverts the factor; the tiles below are multiplied by the inverse, and their products are subtracted from what is left.
/// One step waits for the next one's tile on the diagonal only, so the first warp factorises that while the others subtract.
/// A matrix that is larger than shared memory is taken in parts: so many of its first columns of tiles as there is room for, then what
/// is left, where it lies, after their products are subtracted from it.
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

/// Columns [begin, end) of the lower triangle of tiles, in shared memory, column after column. What a block works on at a time.
class shared_tiles {
 public:
  static constexpr int width = tile_width;

  __device__ shared_tiles(double* memory, int count) : memory_(memory), count_(count) {}
  /// Tiles of a row of the matrix.
  TURBOMAP_HD static int count(int n) { return (n + width - 1) / width; }

  int begin = 0, end = 0;

  /// Goes on from `end`: to the last column, or as far as there is room, and no farther than to what fits at a time then.
  __device__ void advance(int room) {
    begin = end;
    int needed = 0;
    for (int left = count_ - begin; left * (left + 1) / 2 > room && needed + left <= room; --left)
      needed += left, ++end;
    if (end == begin) end = count_;
  }
  /// One warp: tile `first` of them and every `step`-th after it. What is above the diagonal is 0, what is beyond the matrix an
  /// identity.
  __device__ void load(const dense_equations& s, int first, int step) const {
    const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % width;
    for_each(first, step, [&](int i, int j) {
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
    });
  }
  /// f(i, j) for tile `first` of them and every `step`-th after it.
  template <class Function>
  __device__ void for_each(int first, int step, const Function& f) const {
    for (int j = begin, below = first;; below += step) {
      while (below >= count_ - j) {
        below -= count_ - j;
        if (++j >= end) return;
      }
      f(j + below, j);
    }
  }
  /// Of row i and column j, begin <= j < end.
  __device__ shared_tile tile(int i, int j) const {
    const int columns = j - begin, before = columns * (count_ - begin) - columns * (columns - 1) / 2;
    return {memory_ + (before + i - j) * width * width};
  }

 private:
  double* memory_;
  int count_;
};

/// A tile where it lies in device memory.
__device__ inline resident_tile tile_in_memory(const dense_equations& s, int i, int j) {
  const int row = i * tile_width, column = j * tile_width;
  return {s.S + static_cast<std::ptrdiff_t>(column) * s.stride + row, s.stride, s.n - row, s.n - column, i == j};
}

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

/// What is left of the columns and of the right hand side after the columns of tile p. \param rows  the tiles below it
/// \param skip  1: all tasks but the first, the next tile on the diagonal   \param worker  of `workers`, a warp each
__device__ inline void subtract_columns(const shared_tiles& tiles, int p, const unsigned char* rows, int count,
                                        int skip, double* y, int worker, int workers) {
  for (int i = 0, j = skip + worker;; j += workers) {  // row i: i + 1 tiles, then its part of the right hand side
    while (j > i + 1) j -= i + 2, ++i;
    if (i >= count) return;
    const int row = rows[i];
    if (j > i)
      subtract_product<false>(tiles.tile(row, p), y + p * tile_width, y + row * tile_width);
    else if (rows[j] < tiles.end)
      subtract_tiles(tiles.tile(row, rows[j]), tiles.tile(row, p), tiles.tile(rows[j], p));
  }
}

/// The columns go back to where they lie, and their products are subtracted from the tiles behind them. One warp of `warps`.
__device__ inline void subtract_part(const dense_equations& s, const shared_tiles& tiles, const tile_lists& lists,
                                     int count, int warp, int warps) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % tile_width;
  tiles.for_each(warp, warps, [&](int i, int j) {
    const shared_tile from = tiles.tile(i, j);
    const resident_tile to = tile_in_memory(s, i, j);
#pragma unroll
    for (int k = lane / tile_width; k < tile_width; k += 2) to.store(r, k, from.load(r, k));
  });
  for (int i = tiles.end, j = i + warp;; j += warps) {
    while (j > i) j -= i + 1 - tiles.end, ++i;
    if (i >= count) return;
    const resident_tile to = tile_in_memory(s, i, j);
    tile_product sum;
    sum.load(to);
    for (int p = tiles.begin; p < tiles.end; ++p)
      if (lists.has(i, p) && lists.has(j, p)) sum.add(tiles.tile(i, p), tiles.tile(j, p), -1);
    sum.store(to);
  }
}

/// Substitutes back through columns [begin, end): L^T x = y. All warps of the block. \param tile  tile(i, j)
template <class Tile>
__device__ inline void substitute_back(const Tile& tile, const tile_lists& lists, int begin, int end, double* y,
                                       int warp, int warps) {
  if (warp == 0) replace_by_product<true>(tile(end - 1, end - 1), y + (end - 1) * tile_width);
  __syncthreads();
  for (int p = end - 1; p > begin; --p) {  // the first warp has the one that is next
    for (int q = p - 1 - warp; q >= begin; q -= warps) {
      if (lists.has(p, q)) subtract_product<true>(tile(p, q), y + p * tile_width, y + q * tile_width);
      if (q == p - 1) replace_by_product<true>(tile(q, q), y + q * tile_width);
    }
    __syncthreads();
  }
}

}  // namespace detail

/// A block per tile of the lower triangle: s.S into s.ordered in an unknown_order, and behind it whether the tile is not 0.
template <int Threads>
__global__ void __launch_bounds__(Threads) order_unknowns_kernel(dense_equations s) {
  begin_early();
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

/// \param room  tiles that shared memory has room for; no fewer than a column of them has
template <class Tuning>
__global__ void __launch_bounds__(Tuning::threads) solve_dense_kernel(dense_equations s, int room) {
  constexpr int width = detail::tile_width, warps = Tuning::threads / warp_size;
  extern __shared__ double solve_dense_memory[];
  __shared__ int good;
  __shared__ detail::tile_lists lists;
  begin_early();
  if (s.lambda != nullptr && isnan(*s.lambda)) return;
  const int* filled = nullptr;
  if (s.ordered != nullptr) {
    s.S = s.ordered;
    filled = reinterpret_cast<const int*>(s.ordered + static_cast<std::ptrdiff_t>(s.stride) * s.stride);
  }
  const int thread = static_cast<int>(threadIdx.x), warp = thread / warp_size;
  const int count = detail::shared_tiles::count(s.n), padded = count * width;
  double* const y = solve_dense_memory;
  double* const diagonal = y + padded;
  detail::shared_tiles tiles(diagonal + padded, count);
  for (int i = thread; i < padded; i += Tuning::threads) {
    y[i] = i < s.n ? s.x[detail::unordered(s, i)] : 0;
    diagonal[i] = i < s.n ? s.S[static_cast<std::ptrdiff_t>(i) * s.stride + i] : 1;
  }
  const auto factorise = [&](int p) {
    const bool factorised = detail::invert_factor(tiles.tile(p, p), diagonal + p * width, s.tolerance);
    if (thread == 0) good = factorised ? 1 : 0;
  };
  for (;;) {
    tiles.advance(room);
    if (warp == 0) {
      tiles.load(s, 0, count * count);
      __syncwarp();
      factorise(tiles.begin);
    } else {
      tiles.load(s, warp, warps - 1);
      if (warp == 1 && tiles.begin == 0) detail::list_tiles(filled, count, lists);
    }
    __syncthreads();
    for (int p = tiles.begin; p < tiles.end; ++p) {
      if (good == 0) {
        if (thread == 0) *s.solved = 0;
        return;
      }
      const unsigned char* const rows = lists.row[p];
      const int below = lists.count(p);
      const int next = p + 1 < tiles.end && lists.has(p + 1, p) ? 1 : 0;  // whether the next diagonal waits for p
      for (int k = warp; k < below; k += warps) detail::divide_tile(tiles.tile(rows[k], p), tiles.tile(p, p));
      if (warp == warps - 1) detail::replace_by_product<false>(tiles.tile(p, p), y + p * width);
      __syncthreads();
      // Warps 4, 8, ... would share the arithmetic of the first one, for which all wait.
      if (warp % 4 != 0)
        detail::subtract_columns(tiles, p, rows, below, next, y, warp - warp / 4 - 1, warps - warps / 4);
      else if (warp == 0 && p + 1 < tiles.end) {
        if (next == 1) detail::subtract_tiles(tiles.tile(p + 1, p + 1), tiles.tile(p + 1, p), tiles.tile(p + 1, p));
        factorise(p + 1);
      }
      __syncthreads();
    }
    if (tiles.end == count) break;
    detail::subtract_part(s, tiles, lists, count, warp, warps);
    __syncthreads();
  }
  const int parted = tiles.begin;
  detail::substitute_back([&](int i, int j) { return tiles.tile(i, j); }, lists, parted, count, y, warp, warps);
  if (parted > 0) {
    for (int q = warp; q < parted; q += warps)
      for (int p = count - 1; p >= parted; --p)
        if (lists.has(p, q))
          detail::subtract_product<true>(detail::tile_in_memory(s, p, q), y + p * width, y + q * width);
    __syncthreads();
    detail::substitute_back([&](int i, int j) { return detail::tile_in_memory(s, i, j); }, lists, 0, parted, y, warp,
                            warps);
  }
  for (int i = thread; i < s.n; i += Tuning::threads) s.x[detail::unordered(s, i)] = y[i];
  if (thread == 0) *s.solved = 1;
}

template <class Derived>
bool launch_solve_dense(const thrust::cuda_cub::execution_policy<Derived>& policy, const dense_equations& s) {
  static_assert(solve_dense_tuning::unknowns < dense_equations::most_tiles * detail::tile_width);
  if (s.n <= 0 || s.n > solve_dense_tuning::unknowns) return false;
  constexpr int of_kernel = 64 + sizeof(detail::tile_lists);  // bytes of shared memory that are not dynamic
  constexpr int width = detail::tile_width, tile_bytes = width * width * static_cast<int>(sizeof(double));
  int device = 0, most = 0;
  check_cuda(cudaGetDevice(&device), "current device");
  check_cuda(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
             "shared memory of a block");
  const int count = detail::shared_tiles::count(s.n), tiles = count * (count + 1) / 2;
  const int vectors = 2 * count * width * static_cast<int>(sizeof(double));
  const int fitting = (most - of_kernel - vectors) / tile_bytes, room = tiles < fitting ? tiles : fitting;
  if (room < count) return false;
  if (s.ordered != nullptr)
    launch_early(policy, "launch of order_unknowns", 0, order_unknowns_kernel<width * width>, tiles, width * width, s);
  const auto kernel = solve_dense_kernel<solve_dense_tuning>;
  // The attribute belongs to the kernel, which all contexts share: always the same value.
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, most - of_kernel),
             "shared memory of solve_dense");
  launch_early(policy, "launch of solve_dense", static_cast<std::size_t>(vectors + room * tile_bytes), kernel, 1,
               solve_dense_tuning::threads, s, room);
  return true;
}

TURBOMAP_END_NAMESPACE
