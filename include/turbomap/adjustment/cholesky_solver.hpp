// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Solves the reduced system of the frames directly: the policy forms the matrix. In full (local windows) the policy also
/// factorises it where it can (solve_dense.hpp), else the host; block by block (long trajectories) the host does.

#include <cstddef>
#include <type_traits>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../parallel.hpp"
#include "../plain_vector.hpp"
#include "block_cholesky.hpp"
#include "dense_cholesky.hpp"
#include "gradient_iterations.hpp"
#include "order_observations.hpp"
#include "reduced_system.hpp"
#include "solve_dense.hpp"
#include "step_solver.hpp"
#include "step_sums.hpp"
#include "structure.hpp"
#include "unknown_order.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Host memory of the solvers; a problem keeps it.
template <int D>
struct solver_workspace {
  /// \param staging  see context::staging_resource()
  explicit solver_workspace(std::pmr::memory_resource* staging)
      : matrix(staging),
        x(staging),
        b(staging),
        sums(staging),
        report(staging),
        survey(staging),
        pcg(staging),
        observations(staging) {}

  dense_cholesky dense;                                 ///< for matrices in full
  block_cholesky<D> sparse;                             ///< for matrices block by block
  bool analysed = false;                                ///< `sparse` has the structure of the problem
  bool begins_well = true;                              ///< the first step of the last adjustment was accepted
  int ahead = 0;                                        ///< steps taken that were solved for ahead, of all adjustments
  array<double, host_memory> matrix;                    ///< the matrix on the host
  array<double, host_memory> x;                         ///< right hand side, then solution, on the host
  array<double, host_memory> b;                         ///< negative gradient on the host
  array<double, host_memory> sums;                      ///< parts of sums on the host
  array<awaited<step_report>, host_memory> report;      ///< what a step gained, written by the policy
  array<awaited<survey_report>, host_memory> survey;    ///< what the first linearisation is like, written by the policy
  array<awaited<gradient_state>, host_memory> pcg;      ///< how far it is, written by the policy
  array<observation_report, host_memory> observations;  ///< what the policy tells of lists that it made
  plain_vector<double> ordered_x;                       ///< x in an unknown_order
};

/// The reduced matrix in full. The host solves it in an unknown_order where there are others than those of landmarks; it is
/// handed the blocks that exist then, one after the other.
/// \tparam Memory  where it is formed
template <int V, int D, class Memory>
class dense_system {
  static constexpr bool by_blocks = (D > V) && is_host_accessible_v<Memory>;

 public:
  static constexpr bool fills_gaps = !by_blocks;  ///< the matrix has room for blocks that nothing is summed into

  /// Both must outlive this.
  dense_system(solver_workspace<D>& workspace, const adjustment_structure& s)
      : workspace_(workspace),
        structure_(s),
        order_{s.free_frames},
        n_(s.free_frames * D),
        padded_(dense_cholesky::padded(n_)) {
    if constexpr (D > V) lay_out();
  }

  /// Numbers per column, padding included.
  std::size_t unknowns() const { return static_cast<std::size_t>(padded_); }
  /// Numbers of the matrix, padding included.
  std::size_t size() const {
    if (by_blocks) return (static_cast<std::size_t>(structure_.free_frames) + structure_.block_row.size()) * D * D;
    return unknowns() * unknowns();
  }
  /// Where its blocks go.
  reduced_layout layout(double* S, double* rhs) const { return {S, rhs, padded_, !by_blocks}; }
  /// Factorises a matrix on the host by the threads of a policy of the host.
  /// False: singular or not positive definite.
  template <class Policy>
  bool factorise(const Policy& policy, const double* S, double tolerance) {
    auto& solver = workspace_.dense;
    if constexpr (D > V) {
      fill(S);
      if constexpr (is_host_accessible_v<Memory>)
        return solver.factorise_matrix(policy, tolerance);
      else
        return solver.factorise_matrix(tolerance);
    } else if constexpr (is_host_accessible_v<Memory>) {
      return solver.factorise(policy, S, n_, tolerance);
    } else {
      return solver.factorise(S, n_, tolerance);
    }
  }
  /// x = S^-1 x, on the host, by the factor.
  void substitute(double* x) const {
    if constexpr (D > V) {
      auto& ordered = workspace_.ordered_x;
      ordered.resize(unknowns());
      order_.vector(x, ordered.data());
      workspace_.dense.solve(ordered.data());
      order_.restore(ordered.data(), x);
    } else {
      workspace_.dense.solve(x);
    }
  }

 private:
  /// Calls f(a, b, place, joined) with each block on or above the diagonal that there is: where it begins, and whether more than
  /// landmarks joins its frames.
  template <class Function>
  void for_each_block(const Function& f) const {
    const auto& s = structure_;
    const auto row = static_cast<std::ptrdiff_t>(padded_) * D;
    for (int a = 0; a < s.free_frames; ++a) f(a, a, by_blocks ? a * block_size : a * (row + D), true);
    if constexpr (by_blocks) {
      for (std::size_t k = 0; k < s.block_row.size(); ++k)
        f(s.block_row[k], s.block_column[k], (s.free_frames + static_cast<std::ptrdiff_t>(k)) * block_size,
          s.block_factor[k + 1] > s.block_factor[k]);
    } else {
      for (int a = 0; a < s.free_frames; ++a)
        for (int b = a + 1; b < s.free_frames; ++b) f(a, b, a * row + b * D, true);
    }
  }
  void lay_out() {
    auto& matrix = workspace_.dense.matrix();
    matrix.reset(n_);
    for_each_block([&](int a, int b, std::ptrdiff_t, bool joined) { order_.join(a, b, joined ? D : V, matrix); });
    matrix.lay_out();
  }
  void fill(const double* S) {
    auto& matrix = workspace_.dense.matrix();
    matrix.clear();
    for_each_block([&](int a, int b, std::ptrdiff_t place, bool joined) {
      order_.put(a, b, joined ? D : V, S + place, by_blocks ? D : padded_, matrix);
    });
  }

  static constexpr std::ptrdiff_t block_size = D * D;
  solver_workspace<D>& workspace_;
  const adjustment_structure& structure_;
  unknown_order<V, D> order_;
  int n_, padded_;
};

/// The blocks that exist, one after the other.
template <int D>
class sparse_system {
 public:
  static constexpr bool fills_gaps = false;  ///< only the blocks that exist have room

  /// \param workspace  must outlive this
  sparse_system(solver_workspace<D>& workspace, const adjustment_structure& s)
      : factor_(workspace.sparse), frames_(static_cast<std::size_t>(s.free_frames)), blocks_(s.block_row.size()) {
    if (!workspace.analysed) factor_.analyse(s.free_frames, s.block_row, s.block_column);
    workspace.analysed = true;
  }

  /// Numbers of a vector.
  std::size_t unknowns() const { return frames_ * D; }
  /// Numbers of the matrix.
  std::size_t size() const { return (frames_ + blocks_) * D * D; }
  /// Where its blocks go: one after the other.
  reduced_layout layout(double* S, double* rhs) const { return {S, rhs, 0, false}; }
  /// As of dense_system.
  template <class Policy>
  bool factorise(const Policy&, double* S, double tolerance) {
    return factor_.factorise(S, tolerance);
  }
  /// As of dense_system.
  void substitute(double* x) const { factor_.solve(x); }

 private:
  block_cholesky<D>& factor_;
  std::size_t frames_, blocks_;
};

/// \tparam System  dense_system or sparse_system
template <class Policy, class A, int V, int D, class System>
class cholesky_solver final : public detail::step_solver<Policy> {
 public:
  /// \param ctx  its scratch holds the system for the rest of the call   \param workspace  must outlive this
  cholesky_solver(context<Policy>& ctx, const schur_view<A>& s, const adjustment_structure& structure,
                  solver_workspace<D>& workspace)
      : s_(s), workspace_(workspace), system_(workspace, structure) {
    const std::size_t free = static_cast<std::size_t>(s.free_frames) * D;
    matrix_ = ctx.template scratch<double>(system_.size());
    x_ = ctx.template scratch<double>(system_.unknowns() + 1);  // and whether it was solved
    if constexpr (System::fills_gaps && (D > V) && !std::is_same_v<memory_of_t<Policy>, host_memory>)
      ordered_ = ctx.template scratch<double>(dense_equations::ordered_room(static_cast<int>(unknowns())));
    fill_bytes(ctx.policy(), x_ + free, 0, (system_.unknowns() - free) * sizeof(double));
  }

  /// Forms the damped system and solves it. Waits where the host solves it.
  reduced_step solve(context<Policy>& ctx, const damping& damping) override {
    form(ctx, damping);
    solves_there_ = solve_there(ctx);
    if (solves_there_) return enqueued();
    if (!system_.factorise(ctx.policy(), on_host(ctx, matrix_, system_.size(), workspace_.matrix),
                           default_pivot_tolerance))
      return {};
    double* x = on_host(ctx, x_, unknowns(), workspace_.x);
    system_.substitute(x);
    copy_in(ctx.policy(), x_, x, unknowns() * sizeof(double));
    return {true, 0, x_, x};
  }

  /// Whether the policy solved the last system, and can solve the next one without the host.
  bool solves_there() const override { return solves_there_; }
  /// The same as solve(), with a damping that the policy knows by then: nothing waits. \param lambda  see schur_view
  reduced_step solve_ahead(context<Policy>& ctx, const damping& damping, const double* lambda) override {
    s_.lambda = lambda;
    form(ctx, damping);
    solve_there(ctx);
    s_.lambda = nullptr;
    return enqueued();
  }

 private:
  reduced_step enqueued() const { return {true, 0, x_, nullptr, x_ + unknowns()}; }
  bool solve_there(context<Policy>& ctx) {
    if constexpr (System::fills_gaps) {
      const int n = s_.free_frames * D, stride = static_cast<int>(unknowns());
      return launch_solve_dense(
          ctx.policy(), dense_equations{matrix_, x_, x_ + unknowns(), n, stride, default_pivot_tolerance, ordered_,
                                        s_.free_frames, V, s_.lambda});
    }
    return false;
  }
  std::size_t unknowns() const { return system_.unknowns(); }

  void form(context<Policy>& ctx, const damping& damping) {
    if (System::fills_gaps && s_.blocks < s_.free_frames * (s_.free_frames - 1) / 2)
      fill_bytes(ctx.policy(), matrix_, 0, system_.size() * sizeof(double));
    launch_reduce_blocks<V, D>(ctx.policy(), s_, system_.layout(matrix_, x_), damping);
  }

  schur_view<A> s_;
  solver_workspace<D>& workspace_;
  System system_;
  double* matrix_;
  double* x_;
  double* ordered_ = nullptr;  ///< of a device
  bool solves_there_ = false;
};

TURBOMAP_END_NAMESPACE
