// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The options of turbomap-bundle that turbomap-ceres-bundle has too.

#include <CLI/CLI.hpp>

#include "arguments.hpp"
#include "run_program.hpp"

namespace turbomap_bundle {

/// How a problem is adjusted, from which start, and where the result goes. \param a  must outlive `app`
inline void add_options(CLI::App& app, arguments& a) {
  app.add_option("--solver", a.solver, "of the reduced system")
      ->check(CLI::IsMember({"automatic", "dense", "sparse", "pcg"}));
  app.add_option("--precision", a.precision, "numbers that TurboMap computes in")
      ->check(CLI::IsMember({"float64", "mixed", "float32"}));
  app.add_option("--kernel", a.kernel,
                 "robust kernel: none for bal and generated, else huber (5.991, stereo 7.815) when not given")
      ->check(CLI::IsMember({"huber", "none"}));
  app.add_option("--iterations", a.iterations, "at most so many")->check(turbomap_program::not_negative());
  app.add_option("--damping", a.damping, "of H: lambda I, or lambda diag(H), which is the default but for lba")
      ->check(CLI::IsMember({"identity", "diagonal"}));
  app.add_option("--lambda-scale", a.lambda_scale,
                 "first damping: 1e-5 of the largest diagonal element, or 1e-4 of each, when not given")
      ->check(turbomap_program::positive());
  app.add_option("--perturb-m", a.perturb_m, "noise added to free positions and landmarks (not bal, generated, schur)")
      ->check(turbomap_program::not_negative());
  app.add_option("--perturb-rad", a.perturb_rad, "noise added to free rotations (not bal, generated, schur)")
      ->check(turbomap_program::not_negative());
  app.add_option("--json", a.json, "write the result to this file");
}

}  // namespace turbomap_bundle
