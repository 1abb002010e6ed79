// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// launch_adjust_poses() under a CUDA policy: a cluster of blocks per frame instead of one thread, one block below compute
/// capability 9.0. Its threads share the observations of the frame; all else each of them computes for itself, from the same
/// sums, so that they go the same way.

#include "../../config.hpp"
#include "../../cuda/cluster.cuh"
#include "../../cuda/warp.cuh"
#include "../../math/functions.hpp"
#include "../../parallel.hpp"
#include "../adjust_pose.hpp"
#include "tuning.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The threads of a cluster as the team of a frame.
class team_of_cluster {
 public:
  /// @{
  /// Blocks of a frame, the warps of each, and as of team_of_one. `blocks` and `size` are for code on the device only: the host
  /// does not know what it was compiled for.
  static constexpr int warps = adjust_poses_tuning::warps;
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  static constexpr int blocks = adjust_poses_tuning::blocks;
#else
  static constexpr int blocks = 1;
#endif
  static constexpr int threads = warps * warp_size, size = blocks * threads, most = team_of_one::most;
  /// @}
  /// Of each block, in shared memory.
  struct memory {
    /// Sums of the warps of all blocks; in turns, since others may still read those of the last sum.
    double of_warp[2][blocks * warps][most];
    double total[2][most];  ///< by place
  };
  int rank;  ///< number of this thread

  /// \param m  in shared memory
  __device__ explicit team_of_cluster(memory& m)
      : rank(block_of_cluster() * threads + static_cast<int>(threadIdx.x)), memory_(m) {}

  /// As of team_of_one. All threads of the cluster call it.
  template <int N>
  TURBOMAP_HD const double* sum(const double (&x)[N], int place) const {
    static_assert(N <= most && most <= warp_size);
#if defined(__CUDA_ARCH__)  // the body that calls it is compiled for the host too
    constexpr int per_lane = sums_per_lane<warp_size, N>;
    static_assert(per_lane == 1);
    double mine[per_lane];
    sum_numbers<warp_size>(x, mine);
    auto& of_warp = memory_.of_warp[turn_];
    turn_ = 1 - turn_;
    const int lane = rank % warp_size, thread = static_cast<int>(threadIdx.x);
    if (lane < N)
      for (int b = 0; b < blocks; ++b) store_in_cluster(&of_warp[rank / warp_size][lane], b, mine[0]);
    synchronize_cluster();
    if (thread < N) {
      double part[4] = {};  // four sums side by side: one addition waits for the last
#pragma unroll
      for (int w = 0; w < blocks * warps; ++w) part[w % 4] += of_warp[w][thread];
      memory_.total[place][thread] = (part[0] + part[1]) + (part[2] + part[3]);
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
  mutable int turn_ = 0;
};

template <class Camera, bool Exact>
__global__ void __launch_bounds__(team_of_cluster::threads, adjust_poses_tuning::at_once)
    adjust_poses_kernel(adjust_one_pose<Camera, Exact> work) {
  __shared__ team_of_cluster::memory memory;
  synchronize_cluster();  // all blocks are there to be written to
  work.run(static_cast<int>(blockIdx.x) / team_of_cluster::blocks, team_of_cluster(memory));
}

template <class Derived, class Camera, bool Exact>
void launch_adjust_poses(const thrust::cuda_cub::execution_policy<Derived>& policy, int frames,
                         const adjust_one_pose<Camera, Exact>& work) {
  launch_clusters(policy, "launch of adjust_poses", adjust_poses_kernel<Camera, Exact>, frames,
                  adjust_poses_tuning::blocks, team_of_cluster::threads, work);
}

TURBOMAP_END_NAMESPACE
