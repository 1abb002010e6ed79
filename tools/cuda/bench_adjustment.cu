// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The adjustments of turbomap-bench under the CUDA policy. The oracle still runs on one core.

#include "bench/adjustment_stages.hpp"
#include "bench/run_adjustment.hpp"
#include "on_device.cuh"

namespace turbomap_bench {

nlohmann::json run_adjustments_on_device(const turbomap::recording& recording, const arguments& a) {
  return turbomap_program::on_device([&](const auto& policy) { return run_adjustments(policy, recording, a); });
}

}  // namespace turbomap_bench
