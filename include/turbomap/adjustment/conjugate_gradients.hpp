// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Solves the reduced system of the frames by conjugate gradients, preconditioned by its diagonal blocks, without forming it:
/// for problems whose reduced matrix would not fit, or whose factor would fill up.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../math/functions.hpp"
#include "../parallel.hpp"
#include "cholesky_solver.hpp"
#include "frame_vectors.hpp"
#include "gradient_iterations.hpp"
#include "host_sums.hpp"
#include "reduced_system.hpp"
#include "schur_product.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Solves to a relative residual, in the norm of the preconditioner.
template <class Policy, class A, int V, int D>
class pcg_solver final : public detail::step_solver<Policy> {
 public:
  /// \param tolerance  relative, of the residual   \param max_iterations  after so many the step is taken as it is
  pcg_solver(context<Policy>& ctx, const schur_view<A>& s, solver_workspace<D>& workspace, double tolerance,
             int max_iterations)
      : s_(s), workspace_(workspace), tolerance_(tolerance), max_iterations_(max_iterations) {
    const std::size_t f = static_cast<std::size_t>(s.free_frames), n = f * D;
    for (double** v : {&x_, &r_, &z_, &p_, &q_}) *v = ctx.template scratch<double>(n);
    blocks_ = ctx.template scratch<double>(n * D);
    product_ = ctx.template scratch<double>(f), residual_ = ctx.template scratch<double>(f);
    y_ = ctx.template scratch<double>(3 * static_cast<std::size_t>(s.landmarks));
    s_.blocks = 0;  // the diagonal ones alone
    if constexpr (!on_host_) {
      states_ = ctx.template scratch<gradient_state>(2);
      lost_ = ctx.template scratch<std::int32_t>(1);
      workspace.pcg.resize_discard(2);
    }
  }

  /// Solves the damped system. Where the host computes, or cannot be told by the policy, it reads inner products in every iteration.
  reduced_step solve(context<Policy>& ctx, const damping& damping) override {
    const auto& policy = ctx.policy();
    const int f = s_.free_frames;
    const std::size_t n = static_cast<std::size_t>(f) * D;
    launch_reduce_blocks<V, D>(policy, s_, {blocks_, r_, 0, false}, damping);
    launch_factorise_blocks<D>(policy, f, blocks_, product_);
    fill_bytes(policy, x_, 0, n * sizeof(double));
    launch_precondition_frames<D>(policy, f, blocks_, r_, z_, residual_);
    launch_combine_frames<D>(policy, f, z_, 0, z_, p_, nullptr);
    if constexpr (!on_host_)
      if (can_hand_over(workspace_.pcg.data())) return iterate_there(ctx, damping);
    if (sum(ctx, product_) != f) return {};
    double rz = sum(ctx, residual_);
    const double enough = tolerance_ * tolerance_ * rz;
    int i = 0;
    while (i < max_iterations_ && rz > enough) {
      ++i;
      launch_gather_landmarks<V, D>(policy, s_, p_, y_);
      launch_multiply_frames<V, D>(policy, s_, p_, y_, damping, q_);
      launch_combine_frames<D>(policy, f, p_, 0, q_, p_, product_);
      const double pq = sum(ctx, product_);
      if (!(pq > 0) || !detail::is_finite(pq)) break;  // lost to rounding: what there is must do
      const double alpha = rz / pq;
      launch_combine_frames<D>(policy, f, x_, alpha, p_, x_, nullptr);
      launch_combine_frames<D>(policy, f, r_, -alpha, q_, r_, nullptr);
      launch_precondition_frames<D>(policy, f, blocks_, r_, z_, residual_);
      const double next = sum(ctx, residual_);
      launch_combine_frames<D>(policy, f, z_, next / rz, p_, p_, nullptr);
      rz = next;
    }
    return {detail::is_finite(rz), i, x_, on_host(ctx, x_, n, workspace_.x)};
  }

 private:
  static constexpr bool on_host_ = is_host_accessible_v<memory_of_t<Policy>>;

  /// The iterations, where the policy tells how far it is: one is enqueued ahead.
  reduced_step iterate_there(context<Policy>& ctx, const damping& damping) {
    const auto& policy = ctx.policy();
    const int f = s_.free_frames;
    auto* const reports = workspace_.pcg.data();
    const gradient_vectors v{f, blocks_, x_, r_, z_, p_, q_, product_, residual_, states_, lost_};
    launch_begin_gradients(policy, v, tolerance_, reports);
    int turn = 0;
    for (int i = 0; i < max_iterations_; ++i) {
      launch_gradient_iteration<V, D>(policy, s_, damping, y_, v, turn, reports + 1 - turn);
      if (wait_for(policy, reports[turn]).ended != 0) break;
      turn = 1 - turn;
    }
    const gradient_state state = wait_for(policy, reports[turn]);
    const double* x =
        on_host(ctx, x_, static_cast<std::size_t>(f) * D, workspace_.x);  // waits: no report is under way any more
    if (state.solvable == 0) return {};
    return {detail::is_finite(state.rz), state.iterations, x_, x};
  }

  double sum(context<Policy>& ctx, double* parts) {
    const auto n = static_cast<std::size_t>(s_.free_frames);
    return detail::sum_in_order(on_host(ctx, parts, n, workspace_.matrix), n);
  }

  schur_view<A> s_;
  solver_workspace<D>& workspace_;
  double tolerance_;
  int max_iterations_;
  double *x_ = nullptr, *r_ = nullptr, *z_ = nullptr, *p_ = nullptr, *q_ = nullptr, *blocks_ = nullptr,
         *product_ = nullptr, *residual_ = nullptr, *y_ = nullptr;
  gradient_state* states_ = nullptr;
  std::int32_t* lost_ = nullptr;
};

TURBOMAP_END_NAMESPACE
