// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-ceres-bundle: one problem adjusted by TurboMap and by Ceres Solver, in turns, on one core: same start, same
/// number of iterations, one JSON. Built where Ceres is installed.

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <thrust/execution_policy.h>

#include "bundle/ceres_solver.hpp"
#include "bundle/options.hpp"
#include "bundle/run.hpp"
#include "run_program.hpp"
#include "write_json.hpp"

namespace {

using namespace turbomap_bundle;

/// The run whose time per iteration is the median; of an even number, the slower of the two in the middle.
nlohmann::json middle(std::vector<nlohmann::json> runs) {
  const auto at = runs.begin() + static_cast<std::ptrdiff_t>(runs.size() / 2);
  std::nth_element(runs.begin(), at, runs.end(), [](const nlohmann::json& x, const nlohmann::json& y) {
    return x["ms_per_iteration"].get<double>() < y["ms_per_iteration"].get<double>();
  });
  return *at;
}

struct compare {
  const arguments& a;

  nlohmann::json operator()(const turbomap::schur_system&) const {
    throw std::invalid_argument("a Schur system has no residuals that Ceres could adjust");
  }
  template <class Problem>
  nlohmann::json operator()(const Problem& p) const {
    constexpr double scale = is_rig_problem<Problem>::value ? 1 : 0.5;  // of sums of squares; Ceres reports halves
    arguments twice = a;
    twice.repeat = 2;  // the second is timed: a problem uses its memory again, so a program pays for it once
    std::vector<double> ours_ms, ceres_ms;
    std::vector<nlohmann::json> ours_runs, ceres_runs;
    for (int i = 0; i < a.repeat; ++i) {
      ours_runs.push_back(adjust_loaded<decltype(thrust::seq)>{thrust::seq, twice}(p));
      auto copy = p;
      const ceres_result r = solve_by_ceres(copy, a);
      ceres_runs.push_back(r.json(2 * scale));
      ours_ms.push_back(ours_runs.back()["ms_per_iteration"]), ceres_ms.push_back(r.ms_per_iteration);
    }
    auto ours = middle(std::move(ours_runs)), theirs = middle(std::move(ceres_runs));
    ours["ms_per_iteration"] = median(ours_ms), theirs["ms_per_iteration"] = median(ceres_ms);
    return {{"turbomap", ours},
            {"ceres", theirs},
            {"cost_ratio", ours["cost_final"].get<double>() / theirs["cost_final"].get<double>()},
            {"ms_per_iteration_ratio", median(ceres_ms) / median(ours_ms)}};
  }
};

}  // namespace

int main(int argc, char** argv) {
  arguments a;
  CLI::App app("Adjusts one problem by TurboMap and by Ceres Solver.", "turbomap-ceres-bundle");
  app.footer(
      "Examples:\n"
      "  turbomap-ceres-bundle synthetic-lba/30-20-6000 --repeat 3\n"
      "  turbomap-ceres-bundle bal-ladybug-49/problem-49-7776-pre.txt --iterations 50");
  app.add_option("input", a.input, "file or folder of the problem, as for turbomap-bundle")->required();
  add_options(app, a);
  app.add_option("--repeat", a.repeat, "adjust so many times in turns; times are medians")
      ->check(turbomap_program::positive());
  return turbomap_program::run_program(app, argc, argv, [&] {
    const std::string format = format_of(a.input);
    auto json = std::visit(compare{with_damping(a, format)}, load(a, format));
    json["file"] = a.input.string();
    std::printf("%s\n", json.dump(2).c_str());
    turbomap_program::write_json(a.json, json);
    return 0;
  });
}
