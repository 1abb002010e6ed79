// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The CUDA half of the mixed user.

#include "mixed.hpp"

#include <thrust/system/cuda/execution_policy.h>

#include "mapper.hpp"

namespace my {

struct device_mapper::implementation {
  mapper<std::decay_t<decltype(thrust::cuda::par_nosync)>> m{thrust::cuda::par_nosync};
};

bool device_mapper::available() {
  int devices = 0;
  return cudaGetDeviceCount(&devices) == cudaSuccess && devices > 0;
}
device_mapper::device_mapper() : implementation_(std::make_unique<implementation>()) {}
device_mapper::~device_mapper() = default;
void device_mapper::insert(const frame& f) { implementation_->m.insert(f); }
plans device_mapper::map() { return implementation_->m.map(); }

}  // namespace my
