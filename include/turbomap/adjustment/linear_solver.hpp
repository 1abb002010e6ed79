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
#include "block_cholesky.hpp"
#include "dense_cholesky.hpp"
#include "reduced_system.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Host memory of the solvers; a problem keeps it.
template <int D>
struct reduced_workspace {
  dense_cholesky dense;
  block_cholesky<D> sparse;
  bool analysed = false;  ///< `sparse` has the structure of the problem
  std::vector<double> matrix, x, sums;
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
  dense_reduced_solver(context<Policy>& ctx, const schur_view<A>& s, reduced_workspace<D>& workspace)
      : s_(s), workspace_(workspace), n_(s.free_frames * D), padded_(dense_cholesky::padded(n_)) {
    const auto n = static_cast<std::size_t>(padded_);
    matrix_ = ctx.template scratch<double>(n * n);
    x_ = ctx.template scratch<double>(n);
    fill_bytes(ctx.policy(), x_ + n_, 0, (n - static_cast<std::size_t>(n_)) * sizeof(double));
  }

  /// \return the steps of the free frames in the policy's memory through `x`, and a host view of them through
  /// `on_host_x`
  reduced_step solve(context<Policy>& ctx, const damping& damping, double*& x, double*& on_host_x) {
    if (!factorise(ctx, damping)) return {false, 0};
    const std::size_t n = static_cast<std::size_t>(padded_);
    x = x_, on_host_x = on_host(ctx, x_, n, workspace_.x);
    substitute(on_host_x);
    copy_in(ctx.policy(), x, on_host_x, n * sizeof(double));
    return {true, 0};
  }

  /// \param tolerance  see dense_cholesky::factorise
  /// \return false: singular
  bool factorise(context<Policy>& ctx, const damping& damping, double tolerance = default_pivot_tolerance) {
    const std::size_t n = static_cast<std::size_t>(padded_);
    fill_bytes(ctx.policy(), matrix_, 0, n * n * sizeof(double));
    launch_reduction<A, V, D>(ctx.policy(), s_, {matrix_, x_, padded_, true}, damping);
    factor_ = on_host(ctx, matrix_, n * n, workspace_.matrix);
    return workspace_.dense.factorise(factor_, n_, tolerance);
  }

  /// Solves for x in place, on the host; room for padded_size() numbers. After factorise().
  void substitute(double* x) { workspace_.dense.solve(factor_, n_, x); }
  std::size_t padded_size() const { return static_cast<std::size_t>(padded_); }

 private:
  schur_view<A> s_;
  reduced_workspace<D>& workspace_;
  int n_, padded_;
  double* matrix_;
  double* x_;
  double* factor_ = nullptr;
};

/// Forms the blocks that exist and factorises them on the host.
template <class A, int V, int D, class Policy>
class sparse_reduced_solver {
 public:
  /// \param rows, columns  of the blocks
  sparse_reduced_solver(context<Policy>& ctx, const schur_view<A>& s, const std::vector<std::int32_t>& rows,
                        const std::vector<std::int32_t>& columns, reduced_workspace<D>& workspace)
      : s_(s), workspace_(workspace) {
    if (!workspace.analysed) workspace.sparse.analyse(s.free_frames, rows, columns);
    workspace.analysed = true;
    size_ = (static_cast<std::size_t>(s.free_frames) + rows.size()) * D * D;
    blocks_ = ctx.template scratch<double>(size_);
    x_ = ctx.template scratch<double>(static_cast<std::size_t>(s.free_frames) * D);
  }

  reduced_step solve(context<Policy>& ctx, const damping& damping, double*& x, double*& on_host_x) {
    if (!factorise(ctx, damping)) return {false, 0};
    x = x_, on_host_x = on_host(ctx, x_, padded_size(), workspace_.x);
    substitute(on_host_x);
    copy_in(ctx.policy(), x, on_host_x, padded_size() * sizeof(double));
    return {true, 0};
  }

  bool factorise(context<Policy>& ctx, const damping& damping, double tolerance = default_pivot_tolerance) {
    launch_reduction<A, V, D>(ctx.policy(), s_, {blocks_, x_, 0, false}, damping);
    return workspace_.sparse.factorise(on_host(ctx, blocks_, size_, workspace_.matrix), tolerance);
  }
  void substitute(double* x) { workspace_.sparse.solve(x); }
  std::size_t padded_size() const { return static_cast<std::size_t>(s_.free_frames) * D; }

 private:
  schur_view<A> s_;
  reduced_workspace<D>& workspace_;
  std::size_t size_ = 0;
  double* blocks_;
  double* x_;
};

TURBOMAP_END_NAMESPACE
