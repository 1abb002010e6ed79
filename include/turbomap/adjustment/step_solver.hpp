// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The solvers of the reduced system behind one interface, so that the loop that calls them is compiled once for all.

#include "../config.hpp"
#include "../context.hpp"
#include "damping.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Steps of the free frames.
struct reduced_step {
  bool solved = false;  ///< whether there is a step: false where the matrix is singular or not positive definite
  int iterations = 0;   ///< of an iterative solver
  const double* step = nullptr;             ///< where the policy computes
  const double* on_host = nullptr;          ///< null: not asked for
  const double* solved_resident = nullptr;  ///< with no `on_host`: whether it was solved, where the policy computes
};

namespace detail {

/// A solver of the reduced system, whichever it is.
template <class Policy>
class step_solver {
 public:
  /// Solves the damped system.
  virtual reduced_step solve(context<Policy>& ctx, const damping& damping) = 0;
  /// Whether the policy solved the last system, and can solve the next one without the host.
  virtual bool solves_there() const { return false; }
  /// The same as solve(), with a damping that the policy knows by then: nothing waits. \param lambda  see schur_view
  virtual reduced_step solve_ahead(context<Policy>&, const damping&, const double*) { return {}; }

 protected:
  ~step_solver() = default;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
