// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_linearise_frame_factors() under a CUDA policy: a block per factor, of which a window has two dozen. One thread
/// computes residuals and derivatives, all of them their products, an element each in the order of the generic body,
/// which takes factors whose derivatives do not fit the shared memory of a block.

#include <cstddef>

#include "../../config.hpp"
#include "../../cuda/tuning.hpp"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../linearise_frame_factors.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <bool Pair, class Frame, class Factor, class Kernel>
__global__ void __launch_bounds__(frame_factor_tuning::threads)
    linearise_frame_factors_kernel(linearise_frame_factors<Pair, Frame, Factor, Kernel> work) {
  using body = linearise_frame_factors<Pair, Frame, Factor, Kernel>;
  using block = typename body::block;
  constexpr int D = body::D, size = body::size, threads = frame_factor_tuning::threads;
  __shared__ double e[size], d[body::sides][size * D];
  __shared__ bool defined;
  const int i = static_cast<int>(blockIdx.x), thread = static_cast<int>(threadIdx.x);
  if (thread == 0) defined = work.derivatives(i, e, d);
  __syncthreads();
  bool finite = true;
  for (int side = 0; side < body::sides; ++side)
    for (int k = thread; k < size * D; k += threads) finite = finite && detail::is_finite(d[side][k]);
  const double chi2 = defined ? detail::squared_length<size>(e) : 0;
  const bool use = __syncthreads_and(finite) != 0 && defined && detail::is_finite(chi2);
  double rho, w = 0;
  if (use) work.group.kernel(chi2, rho, w);
  for (int side = 0; side < body::sides; ++side) {
    double* out = work.partial_of(i, side);
    for (int k = thread; k < block::partial; k += threads) {
      double x = 0;
      int row = 0, column = k - block::triangle;  // of b
      if (k < block::triangle) {
        while ((row + 1) * (row + 2) / 2 <= k) ++row;
        column = k - row * (row + 1) / 2;
      }
      if (use)
        for (int m = 0; m < size; ++m) {
          const double* at = d[side] + m * D;
          if (k < block::triangle)
            x += w * at[row] * at[column];
          else
            x -= w * at[column] * e[m];
        }
      out[k] = x;
    }
  }
  if constexpr (Pair)
    for (int k = thread; k < D * D; k += threads) {
      double x = 0;
      if (use)
        for (int m = 0; m < size; ++m) x += w * d[0][m * D + k / D] * d[1][m * D + k % D];
      work.square_of(i)[k] = x;
    }
}

template <bool Pair, class Frame, class Derived, class Factor, class Kernel>
void launch_linearise_frame_factors(const thrust::cuda_cub::execution_policy<Derived>& policy,
                                    const frame_factor_view<Factor, Kernel>& group, const estimate_view<Frame>& x,
                                    double* partial, double* square) {
  using body = linearise_frame_factors<Pair, Frame, Factor, Kernel>;
  constexpr std::size_t beside = 64;  // bytes for what else a block keeps
  if constexpr (sizeof(double) * body::size * (1 + body::sides * body::D) + beside > shared_memory_bytes)
    launch_linearise_frame_factors<Pair, Frame>(static_cast<const thrust::execution_policy<Derived>&>(policy), group, x,
                                                partial, square);
  else
    launch_kernel(policy, "launch of linearise_frame_factors",
                  linearise_frame_factors_kernel<Pair, Frame, Factor, Kernel>, group.count,
                  frame_factor_tuning::threads, body{group, x.states, partial, square});
}

TURBOMAP_END_NAMESPACE
