// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-replay under the CUDA policy: the same run, compiled by nvcc.

#include "on_device.cuh"
#include "replay/run.hpp"

namespace turbomap_replay {

outcome run_cuda(const arguments& arguments) {
  return turbomap_program::on_device([&](const auto& policy) { return run(policy, arguments); });
}

}  // namespace turbomap_replay
