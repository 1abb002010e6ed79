// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Thread-block clusters (compute capability 9.0 and later): a few blocks that run at once, read and write each other's shared
/// memory and wait for each other. Below 9.0 a cluster is one block.

#include <cuda_runtime_api.h>

#include "../config.hpp"
#include "parallel.cuh"

TURBOMAP_BEGIN_NAMESPACE

/// The number of this block in its cluster.
__device__ inline int block_of_cluster() {
  unsigned rank = 0;
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("mov.u32 %0, %%cluster_ctarank;" : "=r"(rank));
#endif
  return static_cast<int>(rank);
}

/// Writes to where `place`, in the shared memory of this block, is in that of another block of the cluster.
__device__ inline void store_in_cluster(double* place, int block, double value) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  unsigned there;
  const auto here = static_cast<unsigned>(__cvta_generic_to_shared(place));
  asm volatile("mapa.shared::cluster.u32 %0, %1, %2;" : "=r"(there) : "r"(here), "r"(block));
  asm volatile("st.shared::cluster.f64 [%0], %1;" ::"r"(there), "d"(value) : "memory");
#else
  (void)block;
  *place = value;
#endif
}

/// All threads of the cluster wait for each other, and see what they have written.
__device__ inline void synchronize_cluster() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  __syncwarp();  // `aligned`: the threads of a warp come together
  asm volatile("barrier.cluster.arrive.release.aligned;" ::: "memory");
  asm volatile("barrier.cluster.wait.acquire.aligned;" ::: "memory");
#else
  __syncthreads();
#endif
}

/// Launches `clusters` clusters of `size` blocks of `threads` threads, or, where the kernel was compiled for devices without
/// clusters, so many blocks: one each.
template <class Derived, class... Parameters>
void launch_clusters(const thrust::cuda_cub::execution_policy<Derived>& policy, const char* what,
                     void (*kernel)(Parameters...), int clusters, int size, int threads,
                     typename detail::same_type<Parameters>::type... arguments) {
#if CUDART_VERSION >= 11080
  if (clusters <= 0) return;
  cudaLaunchAttribute shape{};
  shape.id = cudaLaunchAttributeClusterDimension;
  shape.val.clusterDim.x = static_cast<unsigned>(size);
  shape.val.clusterDim.y = shape.val.clusterDim.z = 1;
  void* pointers[] = {static_cast<void*>(&arguments)...};
  if (detail::launch_with_attribute(stream_of(policy), what, 0, kernel, clusters * size, threads, shape, pointers))
    return;
#endif
  launch_kernel(policy, what, kernel, clusters, threads, arguments...);
}

TURBOMAP_END_NAMESPACE
