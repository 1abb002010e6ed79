// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Device and pinned memory as std::pmr resources, the error check, and the one place that asks Thrust for the stream of
/// a policy. Plain and pinned allocations only.

#include <cuda_runtime_api.h>

#include <thrust/system/cuda/detail/execution_policy.h>
#include <thrust/system/cuda/detail/util.h>

#include <cstddef>
#include <memory_resource>
#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "../memory.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws device_error naming the operation when a call of the CUDA run-time did not succeed. The error is answered by that:
/// it does not surface again at somebody else's next launch, unless the device is lost.
inline void check_cuda(cudaError_t status, const char* operation) {
  if (status == cudaSuccess) return;
  cudaGetLastError();
  throw device_error(std::string("turbomap: ") + operation + ": " + cudaGetErrorString(status));
}
/// The same of an allocation: out_of_memory where there is none left. A device that is lost has none to give either, but that
/// is a device_error: callers answer out_of_memory with less work.
inline void check_allocation(cudaError_t status, const char* where, std::size_t bytes) {
  if (status == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    throw out_of_memory(where, bytes);
  }
  check_cuda(status, "allocation");
}

/// The stream of a CUDA policy: the only use of a Thrust internal, kept in one place.
template <class Derived>
cudaStream_t stream_of(const thrust::cuda_cub::execution_policy<Derived>& policy) {
  return thrust::cuda_cub::stream(const_cast<thrust::cuda_cub::execution_policy<Derived>&>(policy));
}

/// cudaMalloc. Throws out_of_memory; device_error when the device has failed.
class cuda_device_resource : public std::pmr::memory_resource {
  void* do_allocate(std::size_t bytes, std::size_t) override {
    void* memory = nullptr;
    check_allocation(cudaMalloc(&memory, bytes), "device", bytes);
    return memory;
  }
  void do_deallocate(void* memory, std::size_t, std::size_t) override { cudaFree(memory); }
  bool do_is_equal(const memory_resource& other) const noexcept override {
    return dynamic_cast<const cuda_device_resource*>(&other) != nullptr;
  }
};

/// cudaMallocHost: page-locked, so that copies run at full rate and asynchronously. Throws as cuda_device_resource.
class cuda_pinned_resource : public std::pmr::memory_resource {
  void* do_allocate(std::size_t bytes, std::size_t) override {
    void* memory = nullptr;
    check_allocation(cudaMallocHost(&memory, bytes), "pinned host", bytes);
    return memory;
  }
  void do_deallocate(void* memory, std::size_t, std::size_t) override { cudaFreeHost(memory); }
  bool do_is_equal(const memory_resource& other) const noexcept override {
    return dynamic_cast<const cuda_pinned_resource*>(&other) != nullptr;
  }
};

/// Where buffers of a CUDA policy come from: device memory. Lives as long as the program.
inline std::pmr::memory_resource* default_resource(device_memory) {
  static cuda_device_resource resource;
  return &resource;
}
/// Where calls of a CUDA policy are staged: pinned host memory. Lives as long as the program.
inline std::pmr::memory_resource* default_staging_resource(device_memory) {
  static cuda_pinned_resource resource;
  return &resource;
}

TURBOMAP_END_NAMESPACE
