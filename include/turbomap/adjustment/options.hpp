// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a bundle adjustment takes and tells, as plain data: options, and a summary of what happened and why it ended.

#include <cstdint>

#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../stop_request.hpp"
#include "damping_rule.hpp"

namespace turbomap {

/// Which numbers an adjustment computes in. States, and the cost that decides about a step, are float64 in the first two.
enum class precision : std::uint8_t {
  float64,
  mixed,   ///< residuals in float64, normal equations in float32, their reduced system factorised in float64
  float32  ///< residuals and normal equations in float32; the factorisation stays float64 (it is small)
};

/// How the reduced system of the frames is solved.
enum class reduced_solver : std::uint8_t {
  automatic,  ///< dense up to adjustment_options::dense_limit unknowns, then sparse, then pcg
  dense,      ///< Cholesky of a full matrix: local problems
  sparse,     ///< Cholesky of the blocks that exist, in a fill-reducing order: long trajectories
  pcg         ///< conjugate gradients on the implicit Schur complement, block-Jacobi preconditioner: large problems
};

/// A pivot below so much of the diagonal element that it came from is rounding: the matrix is singular.
inline constexpr double default_pivot_tolerance = 1e-13;

/// Options of adjust(). Defaults are those of [ORB-SLAM3]'s local adjustment where it has them, but for the damping.
struct adjustment_options {
  int max_iterations = 10;  ///< linearisations
  int max_retries = 10;     ///< larger dampings tried on one linearisation (g2o)
  /// What makes a step shorter.
  damping_rule damping = damping_rule::diagonal;
  double initial_lambda = 0;  ///< damping at the start; 0: by initial_lambda_scale
  /// tau: of the largest diagonal element under `identity`, of each under `diagonal`. 0: 1e-5 [Nielsen 1999; g2o], 1e-4
  /// [Ceres]. Of each element 1e-5 is too little: first steps move weak points too far, and most are refused.
  double initial_lambda_scale = 0;
  double min_relative_decrease = 0;  ///< an iteration that gains less (relative to the cost) is a slow one; 0: never
  int slow_iterations = 3;           ///< as many slow ones in a row end the adjustment [ORB-SLAM3: 1e-3, 3]
  double min_predicted_decrease = 1e-14;  ///< ends where a step promises less than this times the cost
  double time_budget_ms = 0;              ///< ends after the iteration that exceeds it; 0: no limit
  stop_request stop;                      ///< asked between steps; honoured within one iteration
  /// What it computes in.
  precision numbers = precision::mixed;
  /// How the frames are solved for.
  reduced_solver solver = reduced_solver::automatic;
  int dense_limit = 1200;    ///< unknowns up to which `automatic` takes the dense solver
  int sparse_limit = 12000;  ///< unknowns up to which it takes the sparse one
  double sparse_fill = 0.3;  ///< ... unless more than this part of the blocks exist: then pcg
  /// Dense and sparse list all pairs of frames that see one landmark, 8 bytes each. `automatic` takes pcg beyond so many.
  /// Ours: half a GiB.
  std::int64_t pair_limit = std::int64_t{1} << 26;
  double pcg_tolerance = 0.1;    ///< relative residual at which conjugate gradients stop: inexact steps [Ceres: eta]
  int pcg_max_iterations = 500;  ///< of one step
};

/// Why an adjustment ended.
enum class adjustment_end : std::uint8_t {
  max_iterations,   ///< as many as were asked for
  converged,        ///< no gradient left, or the decrease was slow for long enough
  no_descent,       ///< no damping gave a smaller cost: it is as small as the numbers allow
  stopped,          ///< the flag was set
  time_budget,      ///< the time was used up
  no_observations,  ///< there is nothing to adjust to
  nothing_free,     ///< all frames and landmarks are fixed
  not_finite,       ///< the cost at the start is not a number: an input is NaN or infinite
  singular          ///< the reduced system could not be factorised with any damping
};

/// One linearisation with all its steps.
struct adjustment_iteration {
  double cost;            ///< at its end
  double lambda;          ///< of its last step
  int steps;              ///< tried; the last one was accepted unless the adjustment ended
  int linear_iterations;  ///< of conjugate gradients, all steps together
};

/// What an adjustment did. Costs are sums of rho(chi2) over all residual blocks (not halved).
struct adjustment_summary {
  double cost_initial = 0;  ///< of the state that was given
  double cost_final = 0;    ///< of the state that is left
  int iterations = 0;       ///< linearisations that were solved
  int accepted = 0;         ///< iterations that changed the state; 0: it is unchanged to the last bit
  int undefined = 0;        ///< observations whose camera could not project their landmark at the end
  /// Unknowns of free frames whose diagonal element of the undamped normal equations was 0 at the start: no factor that
  /// was defined there, and had a weight, depended on them. Damping alone kept them where they are. Held unknowns and those
  /// of landmarks are not among them. It counts unknowns one by one: directions that several have in common, as a scale, the
  /// heading of a chain of frames, or what one landmark leaves open of a pose, are damped without being counted.
  /// undetermined_directions() counts those, and frame_covariance() says of each frame whether it is determined. 0 where nothing
  /// was linearised.
  int undetermined = 0;
  /// Why it ended.
  adjustment_end end = adjustment_end::max_iterations;
  /// Every iteration, in their order.
  plain_vector<adjustment_iteration> each;
};

/// The words of an adjustment_end, e.g. for a log.
inline const char* to_string(adjustment_end end) {
  switch (end) {
    case adjustment_end::max_iterations:
      return "the number of iterations was reached";
    case adjustment_end::converged:
      return "converged";
    case adjustment_end::no_descent:
      return "no step decreased the cost";
    case adjustment_end::stopped:
      return "stopped by the caller";
    case adjustment_end::time_budget:
      return "the time was used up";
    case adjustment_end::no_observations:
      return "no observations";
    case adjustment_end::nothing_free:
      return "nothing is free to move";
    case adjustment_end::not_finite:
      return "the cost at the start is not finite";
    case adjustment_end::singular:
      return "the reduced system is singular";
  }
  return "unknown";
}

/// The name of a precision, as programs take it.
inline const char* to_string(precision numbers) {
  switch (numbers) {
    case precision::float64:
      return "float64";
    case precision::mixed:
      return "mixed";
    case precision::float32:
      return "float32";
  }
  return "unknown";
}

/// The name of a solver, as programs take it.
inline const char* to_string(reduced_solver solver) {
  switch (solver) {
    case reduced_solver::automatic:
      return "automatic";
    case reduced_solver::dense:
      return "dense";
    case reduced_solver::sparse:
      return "sparse";
    case reduced_solver::pcg:
      return "pcg";
  }
  return "unknown";
}

}  // namespace turbomap
