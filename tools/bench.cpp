// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bench: every stage against its sequential oracle, interleaved in one run. See docs/programs.md.

#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include <turbomap/io/recording.hpp>

#include "bench/machine.hpp"
#include "bench/run.hpp"
#include "bench/run_adjustment.hpp"
#include "host_policy.hpp"
#include "run_program.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"
#include "write_json.hpp"

namespace {

/// Two fisheye cameras of about 1000 keypoints each, 40 keyframes.
turbomap::recording simulated_recording() {
  namespace sim = turbomap::simulation;
  const auto rig = sim::tum_vi_rig();
  sim::simulation_options options;
  options.motion.most_keyframes = 40;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

/// Eleven keyframes of about 3000 keypoints.
turbomap::recording recording_for_calls(const std::string& cameras) {
  namespace sim = turbomap::simulation;
  auto rig = cameras == "stereo" ? sim::euroc_rig() : sim::tum_vi_rig();
  rig.features = cameras == "stereo" ? 3000 : 1500;  // per camera with descriptors
  sim::simulation_options options;
  options.motion.most_keyframes = 11;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}

nlohmann::json run(const turbomap_bench::arguments& a, std::string& machine) {
  const turbomap::recording recording = !a.calls.empty()      ? recording_for_calls(a.calls)
                                        : a.recording.empty() ? simulated_recording()
                                                              : turbomap::read_recording(a.recording);
  const bool adjustments = !a.calls.empty() || !a.recording.empty();
#if defined(TURBOMAP_PROGRAM_WITH_CUDA)
  if (a.policy == "cuda") {
    std::string device;
    nlohmann::json stages = turbomap_bench::run_cuda(recording, a, device);
    machine += ", " + device;
    if (adjustments) stages.update(turbomap_bench::run_adjustments_on_device(recording, a));
    return stages;
  }
#endif
  (void)machine;
  nlohmann::json stages = turbomap_bench::run(turbomap_program::host_policy(a.policy), recording, a);
  if (adjustments) stages.update(turbomap_bench::run_adjustments_on_host(recording, a));
  return stages;
}

}  // namespace

int main(int argc, char** argv) {
  turbomap_bench::arguments a;
  CLI::App app("Times every stage of TurboMap against its sequential oracle, interleaved in one run.",
               "turbomap-bench");
  app.footer(
      "Examples:\n"
      "  turbomap-bench                      all stages, sequential\n"
      "  turbomap-bench --policy omp --json bench.json\n"
      "  turbomap-bench --recording recordings/euroc_v102_stereo\n"
      "  turbomap-bench --calls stereo --policy cuda");
  app.add_option("--recording", a.recording,
                 "a recording with snapshots: the stages on what it recorded, in place of those on a simulated one");
  app.add_option(
         "--calls", a.calls,
         "in place of stages, single calls of search and motion-only adjustment as their size grows, by cameras")
      ->check(CLI::IsMember({"stereo", "fisheyes"}))
      ->excludes("--recording");
  app.add_option("--policy", a.policy, "execution policy")->check(CLI::IsMember({"seq", "omp", "tbb", "cuda"}));
  app.add_option("--json", a.json, "write the result to this file");
  app.add_option("--repetitions", a.repetitions, "samples of each stage, at least 30 to quote them")
      ->check(CLI::Range(1, 100000));
  return turbomap_program::run_program(app, argc, argv, [&] {
    std::string machine = turbomap_bench::processor_name();
    nlohmann::json result;
    result["stages"] = run(a, machine);
    result["machine"] = machine;
    result["policy"] = a.policy;
    std::printf("%s, policy %s, medians of %d\n%-29s %12s %12s %8s %12s\n", machine.c_str(), a.policy.c_str(),
                a.repetitions, "stage (ms)", "ours", "oracle", "ratio", "floor");
    for (const auto& [name, s] : result["stages"].items()) {
      std::printf("%-29s %12.4f", name.c_str(), s["ms_median"].get<double>());
      if (s.contains("ratio"))
        std::printf(" %12.4f %7.1fx", s["oracle_ms_median"].get<double>(), s["ratio"].get<double>());
      else
        std::printf(" %12s %8s", "-", "-");
      std::printf(" %12.4f\n", s.value("floor_ms", 0.0));
    }
    turbomap_program::write_json(a.json, result);
    return 0;
  });
}
