// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recording that turbomap-bench works on, simulated in memory: two fisheye cameras of about 1000 keypoints each.

#include "../simulation/simulate.hpp"
#include "stages.hpp"

namespace turbomap_bench {

template <class Policy>
nlohmann::json run(const Policy& policy, const arguments& a) {
  namespace sim = turbomap::simulation;
  const auto rig = sim::tum_vi_rig();
  sim::simulation_options options;
  options.motion.most_keyframes = 40;
  const auto recording = sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
  return run_stages(policy, recording, a.repetitions);
}

/// Implemented in cuda/bench_cuda.cu where there is CUDA. Throws std::runtime_error without a device.
nlohmann::json run_cuda(const arguments& a, std::string& device);

}  // namespace turbomap_bench
