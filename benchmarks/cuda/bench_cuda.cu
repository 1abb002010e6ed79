// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bench under the CUDA policy: the same stages, compiled by nvcc. The oracle still runs on one core.

#include <cuda_runtime_api.h>

#include <thrust/execution_policy.h>

#include <stdexcept>

#include "../bench/run.hpp"

namespace turbomap_bench {

nlohmann::json run_cuda(const turbomap::recording& recording, const arguments& a, std::string& device) {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0)
    throw std::runtime_error("--policy cuda: there is no CUDA device");
  cudaDeviceProp properties;
  turbomap::check_cuda(cudaGetDeviceProperties(&properties, 0), "properties of the device");
  device = properties.name;
  cudaStream_t stream = nullptr;
  turbomap::check_cuda(cudaStreamCreate(&stream), "creation of a stream");
  nlohmann::json stages = run(thrust::cuda::par_nosync.on(stream), recording, a);
  turbomap::check_cuda(cudaStreamDestroy(stream), "destruction of a stream");
  return stages;
}

}  // namespace turbomap_bench
