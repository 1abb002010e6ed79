// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_adjust_poses() under a CUDA policy: a block per frame instead of one thread. Its threads share the observations of
/// the frame; all else each of them computes for itself, from the same sums, so that they go the same way.

#include "../../config.hpp"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../adjust_pose.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The threads of a block as the team of a frame.
class team_of_block {
 public:
  /// @{
  /// As of team_of_one.
  static constexpr int warps = adjust_poses_tuning::warps, size = warps * warp_size, most = team_of_one::most;
  /// @}
  /// Of the block, in shared memory.
  struct memory {
    double of_warp[warps][most];  ///< sums of each warp
    double total[2][most];        ///< by place
  };
  int rank;  ///< number of this thread

  /// \param m  in shared memory
  __device__ explicit team_of_block(memory& m) : rank(static_cast<int>(threadIdx.x)), memory_(m) {}

  /// As of team_of_one. All threads of the block call it.
  template <int N>
  TURBOMAP_HD const double* sum(const double (&x)[N], int place) const {
    static_assert(N <= most);
#if defined(__CUDA_ARCH__)  // the body that calls it is compiled for the host too
    sum_warp(x, memory_.of_warp[rank / warp_size]);
    __syncthreads();
    if (rank < N) {
      double total = 0;
#pragma unroll
      for (int w = 0; w < warps; ++w) total += memory_.of_warp[w][rank];
      memory_.total[place][rank] = total;
    }
    __syncthreads();
#else
    (void)x;
#endif
    return memory_.total[place];
  }

  /// As team_of_one, unrolled: nothing of it is in memory, and each pivot takes one reciprocal root.
  TURBOMAP_HD bool solve(const double* H, const double* b, double lambda, double (&x)[6]) const {
#if defined(__CUDA_ARCH__)
    double L[6][6], reciprocal[6];
    bool good = true;
#pragma unroll
    for (int j = 0; j < 6; ++j)
#pragma unroll
      for (int i = j; i < 6; ++i) {
        double s = H[i * (i + 1) / 2 + j] + (i == j ? lambda : 0);
#pragma unroll
        for (int m = 0; m < j; ++m) s -= L[i][m] * L[j][m];
        if (i == j) {
          good = good && s > 0 && detail::is_finite(s);
          reciprocal[j] = rsqrt(s);
        }
        L[i][j] = s * reciprocal[j];
      }
#pragma unroll
    for (int i = 0; i < 6; ++i) {
      x[i] = b[i];
#pragma unroll
      for (int j = 0; j < i; ++j) x[i] -= L[i][j] * x[j];
      x[i] *= reciprocal[i];
    }
#pragma unroll
    for (int i = 5; i >= 0; --i) {
#pragma unroll
      for (int j = i + 1; j < 6; ++j) x[i] -= L[j][i] * x[j];
      x[i] *= reciprocal[i];
    }
    return good;
#else
    (void)H, (void)b, (void)lambda, (void)x;
    return false;
#endif
  }

 private:
  memory& memory_;
};

template <class Camera, bool Exact>
__global__ void __launch_bounds__(team_of_block::size) adjust_poses_kernel(adjust_one_pose<Camera, Exact> work) {
  __shared__ team_of_block::memory memory;
  work.run(static_cast<int>(blockIdx.x), team_of_block(memory));
}

template <class Derived, class Camera, bool Exact>
void launch_adjust_poses(const thrust::cuda_cub::execution_policy<Derived>& policy, int frames,
                         const adjust_one_pose<Camera, Exact>& work) {
  launch_kernel(policy, "launch of adjust_poses", adjust_poses_kernel<Camera, Exact>, frames, team_of_block::size,
                work);
}

TURBOMAP_END_NAMESPACE
