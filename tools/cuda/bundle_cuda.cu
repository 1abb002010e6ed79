// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle under the CUDA policy.

#include "bundle/run.hpp"
#include "on_device.cuh"

namespace turbomap_bundle {

outcome run_cuda(const arguments& arguments) {
  return turbomap_program::on_device([&](const auto& policy) { return run(policy, arguments); });
}

}  // namespace turbomap_bundle
