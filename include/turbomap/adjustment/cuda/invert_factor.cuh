// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// invert_factor(): a warp factorises a tile on the diagonal, L L^T, and inverts the factor, in registers. All that a system of
/// equations waits for goes through here, so what a column waits for is kept short: its pivot follows from the one before in each
/// lane, by a multiplication and a sum.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "tile_products.cuh"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A reciprocal within two units of the last place, by one step from that of the hardware: a division takes twice as long.
__device__ inline double quick_reciprocal(double x) {
  double y;
  asm("rcp.approx.ftz.f64 %0, %1;" : "=d"(y) : "d"(x));
  const double e = fma(-x, y, 1.0);
  return fma(y, fma(e, e, e), y);
}
/// 1 over the root of x > 0, likewise. rsqrt() has a branch, which instructions are not moved across.
__device__ inline double quick_rsqrt(double x) {
  double y;
  asm("rsqrt.approx.ftz.f64 %0, %1;" : "=d"(y) : "d"(x));
  const double e = fma(-x * y, y, 1.0);
  return fma(y * e, fma(e, 0.375, 0.5), y);
}

/// One warp: replaces a tile on the diagonal, L L^T, by the inverse of L. Lane r has row r, lane 16 + r that of an identity: the
/// steps that divide the rows below by L^T make the inverse of them. Of the tile only the lower triangle counts; what a lane makes
/// of the rest reaches no other. Eight columns are done with their numbers passed from lane to lane, then taken from the other
/// eight together, by way of shared memory. Roots are taken of all pivots together.
/// \param room  for 8 numbers a lane, at a multiple of 16 bytes   \return false: a pivot is too small
__device__ __forceinline__ bool invert_factor(const shared_tile& tile, const double* diagonal, double tolerance,
                                              double* room) {
  constexpr int width = tile_width, half = width / 2;
  const int lane = static_cast<int>(threadIdx.x) % warp_size, row = lane % width;
  const double one = lane < width ? 0 : 1;
  double a[width], own = 0;
  // Every lane loads, and nothing is skipped: a branch per number would take longer than all else here.
#pragma unroll
  for (int c = 0; c < width; ++c) a[c] = tile.load(row, c);
#pragma unroll
  for (int c = 0; c < width; ++c) a[c] = fma(a[c], 1 - one, c == row ? one : 0.0);
#pragma unroll
  for (int s = 0; s < width; s += half) {
    double scaled[half];
    double pivot = __shfl_sync(whole_warp, a[s], s);
#pragma unroll
    for (int m = 0; m < half; ++m) {
      const int c = s + m;
      own = row == c ? pivot : own;
      const double reciprocal = quick_reciprocal(pivot);
      scaled[m] = a[c] * reciprocal;
      if (m + 1 < half) {
        const double next = __shfl_sync(whole_warp, a[c], c + 1);
        pivot = fma(-(next * next), reciprocal, __shfl_sync(whole_warp, a[c + 1], c + 1));
      }
#pragma unroll
      for (int k = c + 1; k < s + half; ++k) a[k] -= scaled[m] * __shfl_sync(whole_warp, a[c], k);
    }
    if (s + half < width) {
#pragma unroll
      for (int m = 0; m < half; m += 2)
        *reinterpret_cast<double2*>(room + lane * half + m) = make_double2(a[s + m], a[s + m + 1]);
      __syncwarp();
#pragma unroll
      for (int k = s + half; k < width; ++k)
#pragma unroll
        for (int m = 0; m < half; m += 2) {
          const double2 other = *reinterpret_cast<const double2*>(room + k * half + m);
          a[k] -= scaled[m] * other.x;
          a[k] -= scaled[m + 1] * other.y;
        }
    }
  }
  const bool good = own > tolerance * diagonal[row] && own > 0 && is_finite(own);
  const double root = quick_rsqrt(own);
#pragma unroll
  for (int c = 0; c < width; ++c) {
    const double x = a[c] * __shfl_sync(whole_warp, root, c);
    if (lane >= width) tile.store(c, row, x);  // transposed; zeros above the diagonal
  }
  __syncwarp();
  return __all_sync(whole_warp, good) != 0;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
