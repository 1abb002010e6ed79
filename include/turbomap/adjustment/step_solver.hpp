// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The solvers of the reduced system behind one interface, so that the loop that calls them is compiled once for all.

#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "cholesky_solver.hpp"
#include "damping.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A solver of the reduced system, whichever it is.
template <class Policy>
class step_solver {
 public:
  virtual reduced_step solve(context<Policy>& ctx, const damping& damping) = 0;
  virtual bool solves_there() const = 0;
  virtual reduced_step solve_ahead(context<Policy>& ctx, const damping& damping, const double* lambda) = 0;

 protected:
  ~step_solver() = default;
};

template <class Policy, class Solver>
class step_solver_of final : public step_solver<Policy> {
 public:
  template <class... Arguments>
  explicit step_solver_of(Arguments&&... arguments) : solver_(std::forward<Arguments>(arguments)...) {}
  reduced_step solve(context<Policy>& ctx, const damping& damping) override { return solver_.solve(ctx, damping); }
  bool solves_there() const override { return solver_.solves_there(); }
  reduced_step solve_ahead(context<Policy>& ctx, const damping& damping, const double* lambda) override {
    return solver_.solve_ahead(ctx, damping, lambda);
  }

 private:
  Solver solver_;
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
