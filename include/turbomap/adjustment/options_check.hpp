// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What adjust() refuses.

#include "../config.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "methods.hpp"
#include "options.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Throws std::invalid_argument where an option is out of range, or not among the methods of the program.
template <class Methods>
void require_options(const adjustment_options& o) {
  require(o.max_iterations >= 0, "options.max_iterations", o.max_iterations, "must not be negative");
  require(o.max_retries >= 0, "options.max_retries", o.max_retries, "must not be negative");
  require(o.damping == damping_rule::diagonal || o.damping == damping_rule::identity, "options.damping",
          static_cast<int>(o.damping), "is not a damping_rule");
  check_not_negative("options.initial_lambda", o.initial_lambda);
  check_not_negative("options.initial_lambda_scale", o.initial_lambda_scale);
  check_not_negative("options.min_relative_decrease", o.min_relative_decrease);
  check_not_negative("options.min_predicted_decrease", o.min_predicted_decrease);
  require(o.time_budget_ms >= 0, "options.time_budget_ms", o.time_budget_ms, "must not be negative");
  require(o.slow_iterations > 0, "options.slow_iterations", o.slow_iterations, "must be positive");
  require(o.pcg_tolerance > 0 && o.pcg_tolerance < 1, "options.pcg_tolerance", o.pcg_tolerance, "must be in (0, 1)");
  require(o.sparse_fill >= 0, "options.sparse_fill", o.sparse_fill, "must not be negative");
  require(o.pair_limit >= 0, "options.pair_limit", o.pair_limit, "must not be negative");
  require(o.pcg_max_iterations > 0, "options.pcg_max_iterations", o.pcg_max_iterations, "must be positive");
  require(o.solver == reduced_solver::automatic || Methods::solvers::has(o.solver), "options.solver",
          to_string(o.solver), "is not compiled: name it in the methods of adjust()");
  require(Methods::precisions::has(o.numbers), "options.numbers", to_string(o.numbers),
          "is not compiled: name it in the methods of adjust()");
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
