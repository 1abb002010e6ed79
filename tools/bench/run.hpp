// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-bench under each policy, on a recording that the caller simulated.

#include "stages.hpp"

namespace turbomap_bench {

template <class Policy>
nlohmann::json run(const Policy& policy, const turbomap::recording& recording, const arguments& a) {
  return run_stages(policy, recording, a.repetitions);
}

/// Implemented in cuda/bench_cuda.cu where there is CUDA. Throws std::runtime_error without a device.
nlohmann::json run_cuda(const turbomap::recording& recording, const arguments& a, std::string& device);

}  // namespace turbomap_bench
