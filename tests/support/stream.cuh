// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A stream for a test, and the policy of it.

#include <turbomap/memory.hpp>

#include <thrust/system/cuda/execution_policy.h>

#include <type_traits>

namespace turbomap_test {

using stream_policy = std::decay_t<decltype(thrust::cuda::par_nosync.on(cudaStream_t{}))>;

class stream {
 public:
  stream() { turbomap::check_cuda(cudaStreamCreateWithFlags(&handle_, cudaStreamNonBlocking), "creation of a stream"); }
  stream(const stream&) = delete;
  stream& operator=(const stream&) = delete;
  ~stream() { cudaStreamDestroy(handle_); }
  stream_policy policy() const { return thrust::cuda::par_nosync.on(handle_); }
  cudaStream_t handle() const { return handle_; }

 private:
  cudaStream_t handle_ = nullptr;
};

}  // namespace turbomap_test
