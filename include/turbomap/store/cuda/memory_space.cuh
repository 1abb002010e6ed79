// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// memory_space.hpp for the memory of a CUDA device: a stream of its own for copies, events as fences.

#include <cuda_runtime_api.h>

#include <cstddef>
#include <memory_resource>

#include "../../array.hpp"
#include "../../cuda/memory.cuh"
#include "../memory_space.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Copies by a stream of its own, through pinned memory.
template <>
class transfer_lane<device_memory> {
 public:
  /// \param staging  pinned host memory, so that copies are asynchronous
  explicit transfer_lane(std::pmr::memory_resource* staging) : staging_(staging) {
    // Non-blocking: a copy must not wait for work in the legacy default stream, nor hold it up.
    check_cuda(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "creation of a stream for uploads");
  }
  transfer_lane(const transfer_lane&) = delete;
  transfer_lane& operator=(const transfer_lane&) = delete;
  ~transfer_lane() {
    cudaStreamSynchronize(stream_);
    cudaStreamDestroy(stream_);
  }

  /// @{
  /// As the member of this name for host memory; throws device_error. Copies are done after wait().
  void reserve(std::size_t bytes) { staging_.resize_discard(bytes); }
  std::byte* packing_area(std::byte*) { return staging_.data(); }
  void upload(std::byte* resident, const std::byte* host, std::size_t bytes) {
    check_cuda(cudaMemcpyAsync(resident, host, bytes, cudaMemcpyHostToDevice, stream_), "upload of a keyframe");
  }
  void download(std::byte* host, const std::byte* resident, std::size_t bytes) {
    check_cuda(cudaMemcpyAsync(host, resident, bytes, cudaMemcpyDeviceToHost, stream_), "paging out of a keyframe");
  }
  void wait() { check_cuda(cudaStreamSynchronize(stream_), "wait for the copies of keyframes"); }
  void settle() noexcept {
    cudaStreamSynchronize(stream_);
    cudaGetLastError();  // what failed before is under way as an exception
  }
  /// @}

 private:
  array<std::byte, host_memory> staging_;
  cudaStream_t stream_ = nullptr;
};

/// The device that is current when this is made.
template <>
class memory_home<device_memory> {
 public:
  memory_home() { check_cuda(cudaGetDevice(&device_), "look at the current device"); }
  /// While it lives, the device is the thread's current one.
  class visit {
   public:
    /// Throws device_error where the device cannot be chosen.
    explicit visit(const memory_home& home) {
      check_cuda(cudaGetDevice(&before_), "look at the current device");
      if (before_ == home.device_) return;
      check_cuda(cudaSetDevice(home.device_), "choice of the store's device");
      away_ = true;
    }
    visit(const visit&) = delete;
    visit& operator=(const visit&) = delete;
    ~visit() {
      if (away_) cudaSetDevice(before_);
    }

   private:
    int before_ = 0;
    bool away_ = false;
  };

 private:
  int device_ = 0;
};

/// A CUDA policy's stream.
template <>
struct work_order<device_memory> {
  cudaStream_t stream = nullptr;  ///< not owned
};

/// The stream of a CUDA policy.
template <class Derived>
work_order<device_memory> order_of(const thrust::cuda_cub::execution_policy<Derived>& policy) {
  return {stream_of(policy)};
}

/// An event of CUDA.
template <>
class fence<device_memory> {
 public:
  fence() { check_cuda(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming), "creation of an event"); }
  fence(const fence&) = delete;
  fence& operator=(const fence&) = delete;
  ~fence() { cudaEventDestroy(event_); }

  /// Where the stream cannot take an event, waits for it instead: what is behind the fence is then done all the same.
  void record(work_order<device_memory> order) noexcept {
    if (cudaEventRecord(event_, order.stream) != cudaSuccess) {
      cudaGetLastError();
      cudaStreamSynchronize(order.stream);
    }
  }
  /// A device that has failed reads nothing any more: every other error counts as passed, and surfaces at the next
  /// call.
  bool passed() noexcept {
    if (cudaEventQuery(event_) != cudaErrorNotReady) return true;
    cudaGetLastError();
    return false;
  }
  /// Blocks until the work before the mark is done; an error surfaces at the next call.
  void wait() noexcept { cudaEventSynchronize(event_); }

 private:
  cudaEvent_t event_ = nullptr;
};

TURBOMAP_END_NAMESPACE
