// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under the CUDA policy.

#include <cuda_runtime_api.h>

#include <thrust/system/cuda/execution_policy.h>

#include <stdexcept>

#include "../bundle/run.hpp"

namespace turbomap_bundle {

outcome run_cuda(const arguments& arguments) {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0)
    throw std::runtime_error("--policy cuda: there is no CUDA device");
  cudaStream_t stream = nullptr;
  turbomap::check_cuda(cudaStreamCreate(&stream), "creation of a stream");
  outcome result = run(thrust::cuda::par_nosync.on(stream), arguments);
  turbomap::check_cuda(cudaStreamDestroy(stream), "destruction of a stream");
  return result;
}

}  // namespace turbomap_bundle
