// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_solve_dense() under a CUDA policy: Cholesky's method by one thread block, for the systems of local windows. Nothing
/// of the matrix goes to the host. It works on tiles of 16 by 16, a column of them after the other: the tile on the diagonal is
/// factorised, and the factor inverted (invert_factor.cuh); the tiles below are multiplied by the inverse. The first warp does
/// only what the next column waits for; the others subtract from the two columns after it what those before have in common
/// with them.
/// A matrix that is larger than shared memory is taken in parts (shared_tiles.cuh): what is left is changed where it lies.
/// Frames with an IMU are put into an unknown_order first. Two thirds of the tiles are 0 then and stay so; they are left out
/// (tile_lists.cuh).

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../parallel.hpp"
#include "../solve_dense.hpp"
#include "invert_factor.cuh"
#include "shared_tiles.cuh"
#include "tile_lists.cuh"
#include "tile_products.cuh"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One warp: tile times vector. \tparam Transposed  the tile is   \param x  at a multiple of 16 bytes
/// \return in lanes r and 16 + r: element r
template <bool Transposed>
__device__ inline double multiply_vector(const shared_tile& tile, const double* x) {
  constexpr int half = tile_width / 2;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, r = lane % tile_width, first = lane / tile_width * half;
  double sum[2] = {};
#pragma unroll
  for (int k = 0; k < half; k += 2) {
    const double2 pair = *reinterpret_cast<const double2*>(x + first + k);
    sum[0] += (Transposed ? tile.load(first + k, r) : tile.load(r, first + k)) * pair.x;
    sum[1] += (Transposed ? tile.load(first + k + 1, r) : tile.load(r, first + k + 1)) * pair.y;
  }
  sum[0] += sum[1];
  return sum[0] + __shfl_xor_sync(whole_warp, sum[0], tile_width);
}

/// One warp: x <- tile x.
template <bool Transposed>
__device__ inline void replace_by_product(const shared_tile& tile, double* x) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const double y = multiply_vector<Transposed>(tile, x);
  __syncwarp();
  if (lane < tile_width) x[lane] = y;
  __syncwarp();
}
/// One warp: y <- y - tile x.
template <bool Transposed>
__device__ inline void subtract_product(const shared_tile& tile, const double* x, double* y) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size;
  const double p = multiply_vector<Transposed>(tile, x);
  if (lane < tile_width) y[lane] -= p;
  __syncwarp();
}

/// Where unknown `at` of an unknown_order is among the unknowns frame by frame.
__device__ inline int unordered(const dense_equations& s, int at) {
  if (s.ordered == nullptr) return at;
  const int D = s.n / s.frames, others = D - s.seen, first = s.frames * others;
  return at < first ? at / others * D + s.seen + at % others : (at - first) / s.seen * D + (at - first) % s.seen;
}

/// One warp: a <- a times the transpose of `inverse`. \return it as a factor
__device__ inline tile_fragment divide_tile(const shared_tile& a, const shared_tile& inverse) {
  tile_product product;
  product.add(tile_fragment(a), tile_fragment(inverse));
  __syncwarp();
  product.store(a);
  __syncwarp();
  return product.fragment();
}

/// One warp: c, tile (i, j), less the products of rows i and j over `columns`, a bit each, not 0.
template <class C>
__device__ inline void subtract_products(const shared_tiles& tiles, unsigned columns, int i, int j, const C& c) {
  tile_product sum;
  int k = __ffs(columns) - 1;
  tile_fragment a(tiles.tile(i, k)), b(tiles.tile(j, k));
  while ((columns &= columns - 1) != 0) {
    k = __ffs(columns) - 1;
    const tile_fragment next_a(tiles.tile(i, k)), next_b(tiles.tile(j, k));  // while the product is made
    sum.add(a, b);
    a = next_a, b = next_b;
  }
  sum.add(a, b);
  sum.subtract_from(c);
  __syncwarp();
}

/// When column p is known: what columns up to it take from column p + 2, and it alone from p + 1 (whose diagonal is the first
/// warp's) and from the right hand side. Each column so has all that is to be taken from it when its turn comes.
/// \param worker  of `workers`, a warp each
__device__ inline void subtract_columns(const shared_tiles& tiles, const tile_lists& lists, int p, double* y,
                                        int worker, int workers) {
  const int later = p + 2 < tiles.end ? lists.count(p + 2) + 1 : 0;
  const int next = later + (p + 1 < tiles.end && lists.has(p + 1, p) ? lists.count(p + 1) : 0);
  int task = worker;
  for (; task < next; task += workers) {
    const bool is_later = task < later;
    const int j = is_later ? p + 2 : p + 1;
    const int i = is_later ? task == 0 ? j : lists.row[j][task - 1] : lists.row[j][task - later];
    const unsigned columns = lists.common(i, j, is_later ? tiles.begin : p, p + 1);
    if (columns != 0) subtract_products(tiles, columns, i, j, tiles.tile(i, j));
  }
  for (task -= next; task < lists.count(p); task += workers) {
    const int i = lists.row[p][task];
    subtract_product<false>(tiles.tile(i, p), y + p * tile_width, y + i * tile_width);
  }
}

/// The columns go back to where they lie, and their products are subtracted from the tiles behind them. One warp of `warps`.
__device__ inline void subtract_part(const resident_matrix& s, const shared_tiles& tiles, const tile_lists& lists,
                                     int count, int warp, int warps) {
  tiles.store(s, warp, warps);
  lists.for_each(tiles.end, count, warp, warps, [&](int i, int j) {
    const unsigned columns = lists.common(i, j, tiles.begin, tiles.end);
    if (columns != 0) subtract_products(tiles, columns, i, j, s.tile(i, j));
  });
}

/// L^T x = y for the columns of `tiles`, from the last to the first, where x is known of those behind. All warps of the block.
__device__ inline void substitute_back(const shared_tiles& tiles, const tile_lists& lists, int count, double* y,
                                       int warp, int warps) {
  constexpr int width = tile_width;
  for (int p = count; p > tiles.begin; --p) {  // x is known from p on; the first warp has the column that is next
    for (int q = (p < tiles.end ? p : tiles.end) - 1 - warp; q >= tiles.begin; q -= warps) {
      if (p < count && lists.has(p, q)) subtract_product<true>(tiles.tile(p, q), y + p * width, y + q * width);
      if (q == p - 1) replace_by_product<true>(tiles.tile(q, q), y + q * width);
    }
    if (p <= tiles.end) __syncthreads();
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
  using namespace detail;
  constexpr int width = tile_width, threads = Tuning::threads, warps = threads / warp_size;
  extern __shared__ __align__(16) double solve_dense_memory[];
  __shared__ __align__(16) double room_of_factor[8 * warp_size];
  __shared__ bool good[2];  // by column, in turns: a slow warp reads one while the first writes the next
  __shared__ tile_lists lists;
  begin_early();
  if (s.lambda != nullptr && isnan(*s.lambda)) return;
  const int* filled = nullptr;
  if (s.ordered != nullptr) {
    s.S = s.ordered;
    filled = reinterpret_cast<const int*>(s.ordered + static_cast<std::ptrdiff_t>(s.stride) * s.stride);
  }
  const int thread = static_cast<int>(threadIdx.x);
  const int warp = __shfl_sync(whole_warp, thread / warp_size, 0);  // so the compiler knows that it is one number
  const int count = (s.n + width - 1) / width, padded = count * width;
  double* const y = solve_dense_memory;
  double* const diagonal = y + padded;
  const resident_matrix matrix{s.S, s.stride, s.n};
  shared_tiles tiles(diagonal + padded, lists, count);
  for (int i = thread; i < padded; i += threads) {
    y[i] = i < s.n ? s.x[unordered(s, i)] : 0;
    diagonal[i] = i < s.n ? s.S[static_cast<std::ptrdiff_t>(i) * s.stride + i] : 1;
  }
  for (;;) {
    // All wait for this tile: it is the first to be loaded.
    if (warp == 0) {
      shared_tiles::load(matrix, tiles.end, tiles.end, tiles.first_tile());
      __pipeline_commit();
    } else if (warp == 1 && tiles.end == 0)
      list_tiles(filled, count, lists);
    if (tiles.end == 0) __syncthreads();
    tiles.advance(room);
    if (warp != 0)
      tiles.load(matrix, 3, warp, warps - 1);  // a column is changed two steps before its turn: three are needed now
    __pipeline_wait_prior(warp == 0 ? 0 : 1);
    __syncwarp();
    for (int p = tiles.begin - 1; p < tiles.end; ++p) {  // the first time, only the diagonal of the first column
      if (p >= tiles.begin) {
        if (!good[p % 2]) {
          __pipeline_wait_prior(0);  // nothing is still being copied when the block ends
          if (thread == 0) *s.solved = 0;
          return;
        }
        const bool next = p + 1 < tiles.end && lists.has(p + 1, p);  // whether the next diagonal waits for column p
        tile_fragment divided;
        if (warp == 0) {
          if (next) divided = divide_tile(tiles.tile(p + 1, p), tiles.tile(p, p));
        } else {
          const int below = lists.count(p);
          for (int k = warp - (next ? 0 : 1); k < below; k += warps - 1)
            divide_tile(tiles.tile(lists.row[p][k], p), tiles.tile(p, p));
          if (warp == warps - 1) replace_by_product<false>(tiles.tile(p, p), y + p * width);
        }
        __syncthreads();
        // Warps 4, 8, ... would share the arithmetic of the first one, for which all wait.
        if (warp % 4 != 0) {
          subtract_columns(tiles, lists, p, y, warp - warp / 4 - 1, warps - warps / 4);
        } else if (warp == 0 && next) {
          tile_product square;
          square.add(divided, divided);
          square.subtract_from(tiles.tile(p + 1, p + 1));
          __syncwarp();
        }
      }
      if (warp == 0 && p + 1 < tiles.end) {
        const bool factorised =
            invert_factor(tiles.tile(p + 1, p + 1), diagonal + (p + 1) * width, s.tolerance, room_of_factor);
        if (thread == 0) good[(p + 1) % 2] = factorised;
      }
      if (p == tiles.begin) __pipeline_wait_prior(0);
      __syncthreads();
    }
    if (tiles.end == count) break;
    subtract_part(matrix, tiles, lists, count, warp, warps);
    __syncthreads();
  }
  for (;;) {
    substitute_back(tiles, lists, count, y, warp, warps);
    if (tiles.begin == 0) break;
    tiles.retreat(room);
    tiles.load(matrix, 0, warp, warps);
    __pipeline_wait_prior(0);
    __syncthreads();
  }
  for (int i = thread; i < s.n; i += threads) s.x[unordered(s, i)] = y[i];
  if (thread == 0) *s.solved = 1;
}

template <class Derived>
bool launch_solve_dense(const thrust::cuda_cub::execution_policy<Derived>& policy, const dense_equations& s) {
  static_assert(solve_dense_tuning::unknowns < dense_equations::most_tiles * detail::tile_width);
  static_assert(detail::tile_lists::most == dense_equations::most_tiles);
  if (s.n <= 0 || s.n > solve_dense_tuning::unknowns) return false;
  // Bytes of shared memory that are not dynamic.
  constexpr int of_kernel = 64 + sizeof(detail::tile_lists) + 8 * warp_size * sizeof(double);
  constexpr int width = detail::tile_width, tile_bytes = width * width * static_cast<int>(sizeof(double));
  int device = 0, most = 0;
  check_cuda(cudaGetDevice(&device), "current device");
  check_cuda(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
             "shared memory of a block");
  const int count = (s.n + width - 1) / width, tiles = count * (count + 1) / 2;
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
