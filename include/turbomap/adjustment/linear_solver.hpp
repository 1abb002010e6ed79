// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Solvers of the reduced system of the frames.

#include <cstddef>
#include <type_traits>
#include <vector>

#include "../config.hpp"
#include "../context.hpp"
#include "../parallel.hpp"
#include "dense_cholesky.hpp"
#include "options.hpp"
#include "schur.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Host memory of the solvers; a problem keeps it.
struct reduced_workspace {
  dense_cholesky dense;
  std::vector<double> matrix, x;
};

/// Fetches from the policy's memory; under a host policy just looks there.
template <class Policy>
double* on_host(context<Policy>& ctx, double* data, std::size_t n, std::vector<double>& buffer) {
  if constexpr (std::is_same_v<memory_of_t<Policy>, host_memory>) {
    return data;
  } else {
    buffer.resize(n);
    copy_out(ctx.policy(), buffer.data(), data, n * sizeof(double));
    ctx.synchronize();
    return buffer.data();
  }
}

/// How well a step was solved for.
struct reduced_step {
  bool solved;
  int iterations;  ///< of an iterative solver
};

/// Forms the matrix in full and factorises it on the host.
template <class A, int V, int D, class Policy>
class dense_reduced_solver {
 public:
  dense_reduced_solver(context<Policy>& ctx, const schur_view<A>& s, reduced_workspace& workspace)
      : s_(s), workspace_(workspace), n_(s.free_frames * D), padded_(dense_cholesky::padded(n_)) {
    const auto n = static_cast<std::size_t>(padded_);
    matrix_ = ctx.template scratch<double>(n * n);
    x_ = ctx.template scratch<double>(n);
  }

  /// \return the steps of the free frames in the policy's memory through `x`, and a host view of them through `on_host_x`
  reduced_step solve(context<Policy>& ctx, double lambda, double*& x, double*& on_host_x) {
    const std::size_t n = static_cast<std::size_t>(padded_);
    fill_bytes(ctx.policy(), matrix_, 0, n * n * sizeof(double));
    launch_reduction<A, V, D>(ctx.policy(), s_, {matrix_, x_, padded_, true}, lambda);
    double* S = on_host(ctx, matrix_, n * n, workspace_.matrix);
    x = x_, on_host_x = on_host(ctx, x_, n, workspace_.x);
    if (!workspace_.dense.factorise(S, n_)) return {false, 0};
    workspace_.dense.solve(S, n_, on_host_x);
    copy_in(ctx.policy(), x, on_host_x, n * sizeof(double));
    return {true, 0};
  }

 private:
  schur_view<A> s_;
  reduced_workspace& workspace_;
  int n_, padded_;
  double* matrix_;
  double* x_;
};

TURBOMAP_END_NAMESPACE
