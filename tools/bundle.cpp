// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-bundle: adjusts a recorded or published problem and says what it cost. See docs/programs.md.

#include <cstdio>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "bundle/arguments.hpp"
#include "bundle/options.hpp"
#include "run_program.hpp"
#include "write_json.hpp"

namespace {

using turbomap_bundle::arguments;
using turbomap_bundle::outcome;

outcome run(const arguments& a) {
  if (a.page_locked && a.policy != "cuda") throw std::invalid_argument("--page-locked: is for --policy cuda");
#if defined(TURBOMAP_PROGRAM_WITH_CUDA)
  if (a.policy == "cuda") return turbomap_bundle::run_cuda(a);
#endif
  return turbomap_bundle::run_host(a);
}

}  // namespace

int main(int argc, char** argv) {
  arguments a;
  CLI::App app("Adjusts a bundle adjustment problem, or checks a recorded Schur complement.", "turbomap-bundle");
  app.footer(
      "Examples:\n"
      "  turbomap-bundle problem-49-7776-pre.txt                   a problem of Bundle Adjustment in the Large\n"
      "  turbomap-bundle MODEL --policy omp --solver sparse        a COLMAP model in text form\n"
      "  turbomap-bundle PROBLEM --precision float64 --repeat 10   medians of the nine after the first");
  app.add_option("input", a.input, "file or folder of the problem")->required();
  app.add_option(
         "--format", a.format,
         "bal, kitti-stereo, schur, lba (a synthetic problem or a snapshot) or colmap; by content when not given. "
         "generated: the input is CAMERAS,POINTS,OBSERVATIONS of a problem that is made")
      ->check(CLI::IsMember({"bal", "kitti-stereo", "schur", "lba", "colmap", "generated"}));
  app.add_option("--policy", a.policy, "execution policy")->check(CLI::IsMember({"seq", "omp", "tbb", "cuda"}));
  turbomap_bundle::add_options(app, a);
  app.add_option("--repeat", a.repeat, "adjust so many times; times are medians without the first")
      ->check(turbomap_program::positive());
  app.add_flag(
      "--page-locked", a.page_locked,
      "with --policy cuda: rows and points lie in page-locked memory, as those of a system that gathers them there");
  app.add_option("--seed", a.seed, "of the noise, and of a problem that is made");
  app.add_option("--camera", a.camera, "fx fy cx cy bf of a synthetic problem")->expected(5);
  return turbomap_program::run_program(app, argc, argv, [&] {
    const outcome result = run(a);
    std::printf("%s\n", result.json.dump(2).c_str());
    turbomap_program::write_json(a.json, result.json);
    return result.good ? 0 : 1;
  });
}
