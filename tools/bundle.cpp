// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle: adjusts a recorded or published problem and says what it cost. See docs/programs.md.

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "bundle/arguments.hpp"

namespace {

using turbomap_bundle::arguments;
using turbomap_bundle::outcome;

outcome run(const arguments& a) {
#if defined(TURBOMAP_PROGRAM_WITH_CUDA)
  if (a.policy == "cuda") return turbomap_bundle::run_cuda(a);
#endif
  return turbomap_bundle::run_host(a);
}

}  // namespace

int main(int argc, char** argv) try {
  arguments a;
  CLI::App app("Adjusts a bundle adjustment problem, or checks a recorded Schur complement.", "turbomap-bundle");
  app.footer(
      "Examples:\n"
      "  turbomap-bundle problem-49-7776-pre.txt                   a problem of Bundle Adjustment in the Large\n"
      "  turbomap-bundle MODEL --policy omp --solver sparse        a COLMAP model in text form\n"
      "  turbomap-bundle PROBLEM --precision float64 --repeat 10   medians of ten runs");
  app.add_option("input", a.input, "file or folder of the problem")->required();
  app.add_option(
         "--format", a.format,
         "bal, kitti-stereo, schur, lba (a synthetic problem or a snapshot) or colmap; by content when not given. "
         "generated: the input is CAMERAS,POINTS,OBSERVATIONS of a problem that is made")
      ->check(CLI::IsMember({"bal", "kitti-stereo", "schur", "lba", "colmap", "generated"}));
  app.add_option("--policy", a.policy, "execution policy")->check(CLI::IsMember({"seq", "omp", "tbb", "cuda"}));
  app.add_option("--solver", a.solver, "of the reduced system")
      ->check(CLI::IsMember({"automatic", "dense", "sparse", "pcg"}));
  app.add_option("--precision", a.precision, "numbers it computes in")
      ->check(CLI::IsMember({"float64", "mixed", "float32"}));
  app.add_option("--kernel", a.kernel, "robust kernel: none for bal, else huber (5.991, stereo 7.815) when not given")
      ->check(CLI::IsMember({"huber", "none"}));
  app.add_option("--iterations", a.iterations, "at most so many")->check(CLI::NonNegativeNumber);
  app.add_option("--damping", a.damping, "of H: lambda I, or lambda diag(H), which is the default but for lba")
      ->check(CLI::IsMember({"identity", "diagonal"}));
  app.add_option("--lambda-scale", a.lambda_scale,
                 "first damping: 1e-5 of the largest diagonal element, or 1e-4 of each, when not given")
      ->check(CLI::PositiveNumber);
  app.add_option("--repeat", a.repeat, "adjust so many times; times are medians without the first")
      ->check(CLI::PositiveNumber);
  app.add_option("--perturb-m", a.perturb_m, "noise added to free positions and landmarks (not bal)")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--perturb-rad", a.perturb_rad, "noise added to free rotations (not bal)")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--seed", a.seed, "of the noise, and of a problem that is made");
  app.add_option("--camera", a.camera, "fx fy cx cy bf of a synthetic problem")->expected(5);
  app.add_option("--json", a.json, "write the result to this file");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help
    throw;
  }
  const outcome result = run(a);
  std::printf("%s\n", result.json.dump(2).c_str());
  if (!a.json.empty()) {
    std::ofstream file(a.json);
    file << result.json.dump(2) << '\n';
    if (!file.flush()) throw std::runtime_error(a.json.string() + ": cannot be written");
  }
  return result.good ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "turbomap-bundle: %s\n", e.what());
  return 2;
}
