// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bench under the CUDA policy: the same stages, compiled by nvcc. The oracle still runs on one core.

#include "bench/run.hpp"
#include "on_device.cuh"

namespace turbomap_bench {

nlohmann::json run_cuda(const turbomap::recording& recording, const arguments& a, std::string& device) {
  return turbomap_program::on_device([&](const auto& policy) {
    cudaDeviceProp properties;
    turbomap::check_cuda(cudaGetDeviceProperties(&properties, 0), "properties of the device");
    device = properties.name;
    return run(policy, recording, a);
  });
}

}  // namespace turbomap_bench
