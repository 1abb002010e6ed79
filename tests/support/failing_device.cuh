// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Lets those calls of the CUDA runtime fail that a test chooses: allocations of device and pinned memory, and launches, copies and
/// waits. Included before Thrust and the library, whose calls it renames.

#include <cuda_runtime.h>

#include <utility>

namespace turbomap_test {

/// Calls of one kind, of which some fail.
struct failing_calls {
  long left = -1;        ///< calls until one fails; below 0: none fails
  bool for_ever = true;  ///< so do all after it
  bool failed = false;   ///< one has

  bool fails() {
    if (left < 0) return false;
    if (left > 0) return --left, false;
    if (!for_ever) left = -1;
    return failed = true;
  }
};
inline failing_calls allocations, work;

inline cudaError_t counted_malloc(void** memory, std::size_t bytes) {
  return allocations.fails() ? cudaErrorMemoryAllocation : cudaMalloc(memory, bytes);
}
inline cudaError_t counted_malloc_host(void** memory, std::size_t bytes) {
  return allocations.fails() ? cudaErrorMemoryAllocation : cudaMallocHost(memory, bytes);
}
template <class... Arguments>
cudaError_t counted_launch(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchOutOfResources : cudaLaunchKernel(arguments...);
}
template <class... Arguments>
cudaError_t counted_cluster_launch(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchOutOfResources : cudaLaunchKernelExC(arguments...);
}
template <class... Arguments>
cudaError_t counted_look(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaPointerGetAttributes(arguments...);
}
template <class... Arguments>
cudaError_t counted_copy(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaMemcpyAsync(arguments...);
}
template <class... Arguments>
cudaError_t counted_fill(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaMemsetAsync(arguments...);
}
/// It waits even so: on a device that has failed nothing runs any more.
inline cudaError_t counted_wait(cudaStream_t stream) {
  const cudaError_t status = cudaStreamSynchronize(stream);
  return work.fails() ? cudaErrorLaunchFailure : status;
}

/// Not counted: how often it is asked depends on the clock.
inline cudaError_t query_of_lost(cudaStream_t stream) {
  return work.failed && work.for_ever ? cudaErrorLaunchFailure : cudaStreamQuery(stream);
}

template <failing_calls& Calls, bool ForEver>
struct failure_of {
  explicit failure_of(long n) { Calls = {n, ForEver}; }
  failure_of(const failure_of&) = delete;
  failure_of& operator=(const failure_of&) = delete;
  ~failure_of() {
    Calls = {};
    cudaDeviceSynchronize();  // what was launched before has pins until it is done
  }
};

}  // namespace turbomap_test

// What the library calls again and again, here and in Thrust. Streams, events and attributes of kernels and devices are left
// alone.
#define cudaMalloc(memory, bytes) turbomap_test::counted_malloc(memory, bytes)
#define cudaMallocHost(memory, bytes) turbomap_test::counted_malloc_host(memory, bytes)
#define cudaLaunchKernel(...) turbomap_test::counted_launch(__VA_ARGS__)
#define cudaLaunchKernelExC(...) turbomap_test::counted_cluster_launch(__VA_ARGS__)
#define cudaPointerGetAttributes(...) turbomap_test::counted_look(__VA_ARGS__)
#define cudaStreamQuery(stream) turbomap_test::query_of_lost(stream)
#define cudaMemcpyAsync(...) turbomap_test::counted_copy(__VA_ARGS__)
#define cudaMemsetAsync(...) turbomap_test::counted_fill(__VA_ARGS__)
#define cudaStreamSynchronize(stream) turbomap_test::counted_wait(stream)
