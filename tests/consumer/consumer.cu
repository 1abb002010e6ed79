// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A CUDA user, on a stream of their own. Ends with 77 where there is no device.

#include "mapper.hpp"

#include <cstdio>

#include <thrust/system/cuda/execution_policy.h>

int main() {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    std::printf("skipped: no CUDA device\n");
    return 77;
  }
  cudaStream_t stream = nullptr;
  if (cudaStreamCreate(&stream) != cudaSuccess) return 1;
  bool ok = false;
  {
    const auto policy = thrust::cuda::par_nosync.on(stream);
    my::mapper<std::decay_t<decltype(policy)>> mapper(policy);
    for (const my::frame& f : my::make_frames()) mapper.insert(f);
    ok = my::plausible(mapper.map());
  }
  cudaStreamDestroy(stream);
  return ok ? 0 : 1;
}
