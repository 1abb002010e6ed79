// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How a program runs something under the CUDA policy: on a stream of its own, if there is a device, with all kernels
/// loaded, so that the first call takes no longer than the next.

#include <cuda_runtime_api.h>

#include <thrust/system/cuda/execution_policy.h>

#include <cstdlib>
#include <stdexcept>

#include <turbomap/cuda/memory.cuh>

namespace turbomap_program {

/// run(policy), and waits for its stream. Throws std::runtime_error without a device.
template <class Run>
auto on_device(Run run) {
  // Otherwise each kernel is loaded at its first launch. Read when the driver starts; what the user has set stays.
  setenv("CUDA_MODULE_LOADING", "EAGER", 0);
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0)
    throw std::runtime_error("--policy cuda: there is no CUDA device");
  cudaStream_t stream = nullptr;
  turbomap::check_cuda(cudaStreamCreate(&stream), "creation of a stream");
  auto result = run(thrust::cuda::par_nosync.on(stream));
  turbomap::check_cuda(cudaStreamDestroy(stream), "destruction of a stream");
  return result;
}

}  // namespace turbomap_program
