// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_solve_dense() under a CUDA policy: Cholesky's method by one thread block, for the systems of local windows. Nothing
/// of the matrix goes to the host. Right-looking, 16 columns at a time: a warp factorises the square on the diagonal, a thread
/// per row solves the rows below it, then all threads subtract the products of these columns from what is left, in squares of
/// 4 by 4. The right hand side is one row more, so that L y = b is solved on the way.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../solve_dense.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// What the block keeps in shared memory.
struct dense_block {
  static constexpr int width = solve_dense_tuning::columns;
  int n, ld;  ///< ld: n rounded up, the leading dimension of `panel`
  double *panel, *y, *diagonal, *reciprocal;

  __device__ dense_block(int unknowns, double* memory)
      : n(unknowns),
        ld(rounded_up(unknowns)),
        panel(memory),
        y(panel + width * ld),
        diagonal(y + ld),
        reciprocal(diagonal + ld) {}
  static __host__ __device__ int rounded_up(int n) { return (n + 7) / 8 * 8; }
  static std::size_t bytes(int n) { return static_cast<std::size_t>((width + 3) * rounded_up(n)) * sizeof(double); }
};

/// One warp: the square on the diagonal, of which lane r has row r. \return false: a pivot is too small
__device__ inline bool factorise_square(const dense_equations& s, const dense_block& m, int begin, int size,
                                        double (*square)[dense_block::width + 1]) {
  constexpr int width = dense_block::width;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, row = lane < width ? lane : width - 1;
  double a[width];
  bool good = true;
#pragma unroll
  for (int c = 0; c < width; ++c)
    a[c] = row < size && c <= row ? s.S[static_cast<std::ptrdiff_t>(begin + c) * s.stride + begin + row] : row == c;
#pragma unroll
  for (int c = 0; c < width; ++c) {
    const double pivot = __shfl_sync(whole_warp, a[c], c);
    if (c < size) good = good && pivot > s.tolerance * m.diagonal[begin + c] && pivot > 0 && is_finite(pivot);
    const double r = rsqrt(pivot);
    a[c] = row == c ? pivot * r : a[c] * r;
    if (lane == c && c < size) m.reciprocal[begin + c] = r;
#pragma unroll
    for (int k = c + 1; k < width; ++k) a[k] -= a[c] * __shfl_sync(whole_warp, a[c], k);
  }
#pragma unroll
  for (int c = 0; c < width; ++c) {
    if (lane < width) square[lane][c] = a[c];
    if (lane < size && c <= lane) s.S[static_cast<std::ptrdiff_t>(begin + c) * s.stride + begin + lane] = a[c];
  }
  return good;
}

/// The rows below the square: x L^T = what they hold. The row after the last is the right hand side.
/// \param square  volatile, or the compiler takes all of it out of the loop, into registers that there are not
__device__ inline void solve_rows(const dense_equations& s, const dense_block& m, int begin, int size,
                                  const volatile double (*square)[dense_block::width + 1]) {
  constexpr int width = dense_block::width;
  const int first = begin + size, rows = m.n - first, padded = (rows + 3) / 4 * 4;
  for (int t = static_cast<int>(threadIdx.x); t <= padded; t += static_cast<int>(blockDim.x)) {
    const bool is_side = t == padded, is_row = t < rows;
    double x[width];
#pragma unroll
    for (int c = 0; c < width; ++c)
      x[c] = c >= size ? 0
             : is_side ? m.y[begin + c]
             : is_row  ? s.S[static_cast<std::ptrdiff_t>(begin + c) * s.stride + first + t]
                       : 0;
#pragma unroll
    for (int c = 0; c < width; ++c) {
      x[c] *= c < size ? m.reciprocal[begin + c] : 0;
#pragma unroll
      for (int k = c + 1; k < width; ++k) x[k] -= x[c] * square[k][c];
    }
#pragma unroll
    for (int c = 0; c < width; ++c) {
      if (is_side) {
        if (c < size) m.y[begin + c] = x[c];
        continue;
      }
      m.panel[c * m.ld + t] = x[c];
      if (is_row && c < size) s.S[static_cast<std::ptrdiff_t>(begin + c) * s.stride + first + t] = x[c];
    }
  }
}

/// Subtracts the products of the columns from what is right of them, and from the right hand side.
__device__ inline void subtract_products(const dense_equations& s, const dense_block& m, int begin, int size) {
  constexpr int width = dense_block::width, tile = 4;
  const int first = begin + size, rows = m.n - first, tiles = (rows + tile - 1) / tile;
  const int threads = static_cast<int>(blockDim.x), thread = static_cast<int>(threadIdx.x);
  // Columns of tiles get shorter from left to right: a long and a short one make tiles + 1.
  for (int t = thread; t < (tiles + 1) / 2 * (tiles + 1); t += threads) {
    const int pair = t / (tiles + 1), at = t % (tiles + 1), mirrored = tiles - 1 - pair;
    const bool is_long = at < tiles - pair;
    if (!is_long && mirrored == pair) continue;
    const int column = is_long ? pair : mirrored, row = is_long ? pair + at : mirrored + at - (tiles - pair);
    double sum[tile][tile];
    double* const S = s.S + static_cast<std::ptrdiff_t>(first + column * tile) * s.stride + first + row * tile;
#pragma unroll
    for (int k = 0; k < tile; ++k)
#pragma unroll
      for (int i = 0; i < tile; ++i) sum[k][i] = S[static_cast<std::ptrdiff_t>(k) * s.stride + i];
#pragma unroll 4
    for (int c = 0; c < width; ++c) {
      const double *a = m.panel + c * m.ld + row * tile, *b = m.panel + c * m.ld + column * tile;
#pragma unroll
      for (int k = 0; k < tile; ++k)
#pragma unroll
        for (int i = 0; i < tile; ++i) sum[k][i] -= a[i] * b[k];
    }
#pragma unroll
    for (int k = 0; k < tile; ++k)
#pragma unroll
      for (int i = 0; i < tile; ++i) S[static_cast<std::ptrdiff_t>(k) * s.stride + i] = sum[k][i];
  }
  for (int t = thread; t < rows; t += threads) {
    double sum = 0;
    for (int c = 0; c < size; ++c) sum += m.panel[c * m.ld + t] * m.y[begin + c];
    m.y[first + t] -= sum;
  }
}

/// L^T x = y for the unknowns from `begin`, when those after them are known. All threads.
__device__ inline void substitute_back(const dense_equations& s, const dense_block& m, int begin, int size) {
  constexpr int width = dense_block::width;
  const int thread = static_cast<int>(threadIdx.x), lane = thread % warp_size;
  for (int c = thread / warp_size; c < size; c += static_cast<int>(blockDim.x) / warp_size) {
    const double* column = s.S + static_cast<std::ptrdiff_t>(begin + c) * s.stride;
    double sum = 0;
    for (int i = begin + size + lane; i < m.n; i += warp_size) sum += column[i] * m.y[i];
    sum = sum_lanes<warp_size>(sum);
    if (lane == 0) m.y[begin + c] -= sum;
  }
  __syncthreads();
  if (thread < warp_size) {
    double column[width], y = lane < size ? m.y[begin + lane] : 0;
#pragma unroll
    for (int r = 0; r < width; ++r)
      column[r] = lane < r && r < size ? s.S[static_cast<std::ptrdiff_t>(begin + lane) * s.stride + begin + r] : 0;
#pragma unroll
    for (int r = width - 1; r >= 0; --r) {
      const double x = __shfl_sync(whole_warp, y, r) * (r < size ? m.reciprocal[begin + r] : 0);
      y = lane == r ? x : y - column[r] * x;
    }
    if (lane < size) m.y[begin + lane] = y;
  }
  __syncthreads();
}

}  // namespace detail

template <class Tuning>  // a template, so that several units may have it
__global__ void __launch_bounds__(Tuning::threads) solve_dense_kernel(dense_equations s) {
  constexpr int width = detail::dense_block::width;
  extern __shared__ double solve_dense_memory[];
  __shared__ double square[width][width + 1];
  __shared__ int good;
  const detail::dense_block m(s.n, solve_dense_memory);
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  for (int i = thread; i < s.n; i += threads) {
    m.y[i] = s.x[i];
    m.diagonal[i] = s.S[static_cast<std::ptrdiff_t>(i) * s.stride + i];
  }
  __syncthreads();
  for (int begin = 0; begin < s.n; begin += width) {
    const int size = s.n - begin < width ? s.n - begin : width;
    if (thread < warp_size) {
      const bool factorised = detail::factorise_square(s, m, begin, size, square);
      if (thread == 0) good = factorised ? 1 : 0;
    }
    __syncthreads();
    if (good == 0) {
      if (thread == 0) *s.solved = 0;
      return;
    }
    detail::solve_rows(s, m, begin, size, square);
    __syncthreads();
    detail::subtract_products(s, m, begin, size);
    __syncthreads();
  }
  for (int begin = (s.n - 1) / width * width; begin >= 0; begin -= width)
    detail::substitute_back(s, m, begin, s.n - begin < width ? s.n - begin : width);
  for (int i = thread; i < s.n; i += threads) s.x[i] = m.y[i];
  if (thread == 0) *s.solved = 1;
}

template <class Derived>
bool launch_solve_dense(const thrust::cuda_cub::execution_policy<Derived>& policy, const dense_equations& s) {
  if (s.n <= 0 || s.n > solve_dense_tuning::unknowns) return false;
  const std::size_t bytes = detail::dense_block::bytes(s.n);
  const auto kernel = solve_dense_kernel<solve_dense_tuning>;
  // The attribute belongs to the kernel, which all contexts share: always the same value.
  const int most = static_cast<int>(detail::dense_block::bytes(solve_dense_tuning::unknowns));
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, most),
             "shared memory of solve_dense");
  launch_kernel_with(policy, "launch of solve_dense", bytes, kernel, 1, solve_dense_tuning::threads, s);
  return true;
}

TURBOMAP_END_NAMESPACE
