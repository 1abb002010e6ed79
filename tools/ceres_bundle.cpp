// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-ceres-bundle: one problem adjusted by TurboMap and by Ceres Solver, in turns, on one core: same start, same
/// number of iterations, one JSON. Built where Ceres is installed.

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <thrust/execution_policy.h>

#include "bundle/ceres_solver.hpp"
#include "bundle/run.hpp"

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

int main(int argc, char** argv) try {
  arguments a;
  CLI::App app("Adjusts one problem by TurboMap and by Ceres Solver.", "turbomap-ceres-bundle");
  app.footer(
      "Examples:\n"
      "  turbomap-ceres-bundle synthetic-lba/30-20-6000 --repeat 3\n"
      "  turbomap-ceres-bundle bal-ladybug-49/problem-49-7776-pre.txt --iterations 50");
  app.add_option("input", a.input, "file or folder of the problem, as for turbomap-bundle")->required();
  app.add_option("--solver", a.solver, "of the reduced system")
      ->check(CLI::IsMember({"automatic", "dense", "sparse", "pcg"}));
  app.add_option("--precision", a.precision, "numbers that TurboMap computes in")
      ->check(CLI::IsMember({"float64", "mixed", "float32"}));
  app.add_option("--kernel", a.kernel, "none for bal, else huber when not given")
      ->check(CLI::IsMember({"huber", "none"}));
  app.add_option("--iterations", a.iterations, "at most so many")->check(CLI::NonNegativeNumber);
  app.add_option("--damping", a.damping, "of H: lambda I, or lambda diag(H), which is the default but for lba")
      ->check(CLI::IsMember({"identity", "diagonal"}));
  app.add_option("--lambda-scale", a.lambda_scale,
                 "first damping: 1e-5 of the largest diagonal element, or 1e-4 of each, when not given")
      ->check(CLI::PositiveNumber);
  app.add_option("--repeat", a.repeat, "adjust so many times in turns; times are medians")->check(CLI::PositiveNumber);
  app.add_option("--perturb-m", a.perturb_m, "noise added to free positions and landmarks (not bal)");
  app.add_option("--perturb-rad", a.perturb_rad, "noise added to free rotations (not bal)");
  app.add_option("--json", a.json, "write the result to this file");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help
    throw;
  }
  const std::string format = format_of(a.input);
  auto json = std::visit(compare{with_damping(a, format)}, load(a, format));
  json["file"] = a.input.string();
  std::printf("%s\n", json.dump(2).c_str());
  if (!a.json.empty()) {
    std::ofstream file(a.json);
    file << json.dump(2) << '\n';
    if (!file.flush()) throw std::runtime_error(a.json.string() + ": cannot be written");
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "turbomap-ceres-bundle: %s\n", e.what());
  return 2;
}
