// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-bench under each policy: every stage on a recording that the caller simulated, or the snapshots of one that was
/// recorded, or single calls.

#include "recorded_stages.hpp"
#include "search_calls.hpp"
#include "stages.hpp"

namespace turbomap_bench {

template <class Policy>
nlohmann::json run(const Policy& policy, const turbomap::recording& recording, const arguments& a) {
  if (!a.calls.empty())
    return recording.meta.is_fisheye() ? run_search_calls<fisheye>(policy, recording, a.repetitions)
                                       : run_search_calls<turbomap::pinhole<float>>(policy, recording, a.repetitions);
  if (a.recording.empty()) return run_stages(policy, recording, a.repetitions);
  if (recording.meta.is_fisheye())
    return recorded_stages<fisheye, Policy>(policy, recording, a.recording, a.repetitions).run();
  return recorded_stages<turbomap::pinhole<float>, Policy>(policy, recording, a.recording, a.repetitions).run();
}

/// Implemented in cuda/bench_cuda.cu where there is CUDA. Throws std::runtime_error without a device.
nlohmann::json run_cuda(const turbomap::recording& recording, const arguments& a, std::string& device);

}  // namespace turbomap_bench
