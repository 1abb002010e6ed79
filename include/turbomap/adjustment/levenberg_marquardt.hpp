// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Bundle adjustment: adjust(). Each iteration replaces the cost by the square of linearised residuals, adds a damping to
/// its normal equations, and solves for a step (Levenberg and Marquardt's method); a step that makes the cost larger is taken
/// back and tried again with more damping (Nielsen's rule). The landmarks are eliminated first (Schur complement), so that
/// the system to solve is that of the frames. The loop is one for host and device.

#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "../named_range.hpp"
#include "../precompiled.hpp"
#include "cholesky_solver.hpp"
#include "choose_solver.hpp"
#include "conjugate_gradients.hpp"
#include "damping.hpp"
#include "host_sums.hpp"
#include "methods.hpp"
#include "move_frames.hpp"
#include "options.hpp"
#include "options_check.hpp"
#include "problem.hpp"
#include "step_solver.hpp"
#include "substitute_landmarks.hpp"
#include "tracked_equations.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One adjustment of one problem in one precision; adjust() runs it.
/// \tparam Data  a problem_data
/// \tparam G     numbers of residuals   \tparam A  numbers of the normal equations of landmarks
template <class Policy, class Data, class G, class A>
class levenberg_marquardt {
  using clock = std::chrono::steady_clock;
  using solver_type = detail::step_solver<Policy>;
  static constexpr int V = Data::landmark_dof, D = Data::dof;

 public:
  /// \param ctx,data  must outlive this; `data` holds the start, and the result afterwards   \param options  checked by the caller
  levenberg_marquardt(context<Policy>& ctx, Data& data, const adjustment_options& options)
      : ctx_(ctx), data_(data), options_(options), start_(clock::now()), equations_(begin(ctx), data) {
    if constexpr (is_host_accessible_v<memory_of_t<Policy>>) hopeful_ = data.workspace.begins_well;
    gains_ = ctx.template scratch<double>(gain_count());
    next_lambda_ = ctx.template scratch<double>(1);
  }

  /// Iterates to the end. \tparam Solvers  methods that are compiled
  template <class Solvers>
  adjustment_summary run() {
    try {
      summary_.end = start<Solvers>();
    } catch (...) {
      ctx_.settle();  // a report may be under way that the next call would take for its own
      throw;
    }
    ctx_.synchronize();  // something may have been computed ahead
    return std::move(summary_);
  }

 private:
  static context<Policy>& begin(context<Policy>& ctx) { return ctx.begin_call(), ctx; }

  template <class Solvers>
  adjustment_end start() {
    if (data_.observations == 0) return adjustment_end::no_observations;
    if (!data_.finite) return adjustment_end::not_finite;
    const bool nothing_free = data_.structure.free_frames == 0 && !data_.landmarks_move();
    reduced_solver chosen{};
    if (!nothing_free) {  // first: lists are made while the host waits for the cost
      chosen = choose_solver<Solvers>(ctx_, data_, options_);
      if (chosen != reduced_solver::pcg) equations_.now().need_blocks(ctx_, chosen == reduced_solver::dense);
    }
    const double cost =
        equations_.evaluate(data_.estimate.current(), options_.max_iterations > 0 && !nothing_free && !stopped());
    summary_.cost_initial = summary_.cost_final = cost;
    if (!detail::is_finite(cost)) return adjustment_end::not_finite;
    summary_.undefined = equations_.now().undefined();
    if (nothing_free) return adjustment_end::nothing_free;
    const schur_view<A>& s = equations_.now().view();
    if constexpr (Solvers::has(reduced_solver::dense))
      if (chosen == reduced_solver::dense)
        return iterate(cholesky_solver<Policy, A, V, D, dense_system<V, D, memory_of_t<Policy>>>(
            ctx_, s, data_.structure, data_.workspace));
    if constexpr (Solvers::has(reduced_solver::sparse))
      if (chosen == reduced_solver::sparse)
        return iterate(cholesky_solver<Policy, A, V, D, sparse_system<D>>(ctx_, s, data_.structure, data_.workspace));
    if constexpr (Solvers::has(reduced_solver::pcg))
      return iterate(
          pcg_solver<Policy, A, V, D>(ctx_, s, data_.workspace, options_.pcg_tolerance, options_.pcg_max_iterations));
    return adjustment_end::singular;  // not reached: choose_solver() gives one that there is
  }

  adjustment_end iterate(solver_type&& solver) {
    double cost = summary_.cost_initial;
    damping_control control{options_.initial_lambda};
    summary_.each.reserve(static_cast<std::size_t>(options_.max_iterations < 100 ? options_.max_iterations : 100));
    for (int i = 0; i < options_.max_iterations; ++i) {
      if (stopped()) return adjustment_end::stopped;
      if (i > 0 && out_of_time()) return adjustment_end::time_budget;
      equations_.linearise();
      if (i == 0) survey(!(control.lambda > 0));
      if (i == 0 && !(control.lambda > 0)) {
        control.lambda = first_lambda();
        if (!(largest_ > 0)) return adjustment_end::converged;  // no factor depends on anything
      }
      ++summary_.iterations;
      const double before = cost;
      adjustment_iteration it{cost, control.lambda, 0, 0};
      const bool more = i + 1 < options_.max_iterations;
      const adjustment_end end = retry(solver, control, cost, it, more);
      it.cost = summary_.cost_final = cost;
      summary_.each.push_back(it);
      if (end != accepted) return end;
      slow_ = before - cost < options_.min_relative_decrease * before ? slow_ + 1 : 0;
      if (slow_ >= options_.slow_iterations) return adjustment_end::converged;
    }
    return adjustment_end::max_iterations;
  }

  /// What there is to know of the first linearisation.
  void survey(bool scale) {
    if (const survey_report* found = equations_.now().survey(ctx_, scale)) {
      summary_.undetermined = static_cast<int>(found->undetermined);
      if (scale) largest_ = found->largest;
    } else {
      summary_.undetermined = equations_.now().undetermined(ctx_);
    }
  }

  /// The damping that the options stand for where they give none.
  double first_lambda() {
    if (largest_ < 0) largest_ = equations_.now().largest_diagonal(ctx_);
    const bool of_each = options_.damping == damping_rule::diagonal;
    const double given = options_.initial_lambda_scale, scale = given > 0 ? given : of_each ? 1e-4 : 1e-5;
    return of_each ? scale : scale * largest_;
  }

  /// What retry() returns where the adjustment goes on.
  static constexpr adjustment_end accepted = adjustment_end::max_iterations;

  /// A step that was applied to the trial estimate.
  struct trial_step {
    bool solved;             ///< false: there is none, the system could not be solved
    int linear_iterations;   ///< of the solver
    double predicted = 0;    ///< the decrease that the quadratic model promises, the sum of dx (damping dx + b)
    bool evaluated = false;  ///< the cost there is known by the way
    double cost = 0;         ///< that cost
  };

  /// Steps of one linearisation, with more and more damping, until one makes the cost smaller.
  /// \param more  another iteration may follow
  adjustment_end retry(solver_type& solver, damping_control& control, double& cost, adjustment_iteration& it,
                       bool more) {
    bool factorised = false;
    while (it.steps <= options_.max_retries) {
      equations_.linearise();  // anew where it was at an estimate that was refused
      ++it.steps, it.lambda = control.lambda;
      trial_step step = take_step(solver, control, cost, more && hopeful_);
      it.linear_iterations += step.linear_iterations;
      if (step.solved) {
        factorised = true;
        if (!(step.predicted > options_.min_predicted_decrease * cost) && detail::is_finite(step.predicted)) {
          // The step promises nothing: no gradient is left, or too much damping.
          equations_.linearise();
          if (!(equations_.now().gradient_gain(ctx_) > options_.min_predicted_decrease * cost))
            return adjustment_end::converged;
          if (it.steps > 1 || !(control.lambda > first_lambda())) return adjustment_end::no_descent;
          control.lambda = first_lambda();
          continue;
        }
        if (!step.evaluated)
          step.cost =
              equations_.evaluate(data_.estimate.trial(), more && hopeful_ && step.predicted >= ending_gain(cost));
        hopeful_ = control.accepts(cost, step.cost, step.predicted);
        if (summary_.accepted == 0 && it.steps == 1) data_.workspace.begins_well = hopeful_;
        if (hopeful_) {
          cost = step.cost;
          equations_.accept();
          solved_ = equations_.formed() && next_damping_ == control.lambda;
          summary_.undefined = equations_.now().undefined();
          ++summary_.accepted;
          return accepted;
        }
      } else {
        control.refuse();
      }
      if (!detail::is_finite(control.lambda)) break;
      if (stopped()) return adjustment_end::stopped;
    }
    return factorised ? adjustment_end::no_descent : adjustment_end::singular;
  }

  /// Solves for a step with a damping and applies it to the trial estimate.
  /// \param ahead  see tracked_equations::evaluate(); the solver solves for the next step too, where it can, while the host judges
  ///               this one
  trial_step take_step(solver_type& solver, const damping_control& control, double cost, bool ahead) {
    const damping damping{control.lambda, options_.damping == damping_rule::diagonal};
    const schur_view<A>& s = equations_.now().view();
    const auto& policy = ctx_.policy();
    reduced_step step = next_step_;
    if (solved_) {
      ++data_.workspace.ahead;
    } else {
      launch_eliminate_landmarks<V>(policy, s, damping);
      step = solver.solve(ctx_, damping);
    }
    solved_ = false;
    if (!step.solved) return {false, step.iterations};
    const auto from = data_.estimate.current(), to = data_.estimate.trial();
    const int frames = data_.structure.frames;
    launch_take_step<V, D>(policy, s, step.step, damping, frames, from, to, gains_);
    const std::size_t n = static_cast<std::size_t>(s.free_frames) * D, triangles = n / D * frame_block<D>::triangle;
    step_parts parts{nullptr, 0, gains_, gain_count(), step.step, s.b, s.H, n, step.solved_resident, damping};
    if (ahead && Data::reprojections_only && solver.solves_there()) {
      parts.next_lambda = next_lambda_, parts.control = control, parts.cost_before = cost;
      parts.least_predicted = options_.min_predicted_decrease * cost;
      parts.least_decrease = ending_gain(cost);
    }
    const auto next = [&] {
      if (parts.next_lambda == nullptr) return equations_.now().form(ctx_, to);
      equations_.now().form_and_eliminate(ctx_, to, parts.damping, parts.next_lambda);
      next_step_ = solver.solve_ahead(ctx_, parts.damping, parts.next_lambda);
    };
    if (const step_report* report = equations_.evaluate_step(to, parts, ahead, next)) {
      next_damping_ = report->lambda;
      return {report->solved != 0, step.iterations, report->predicted, true, report->cost};
    }
    auto& w = data_.workspace;
    const double* x = step.on_host != nullptr ? step.on_host : ctx_.on_host(step.step, n, w.x);
    double solved = 1;
    if (step.solved_resident != nullptr) copy_out(policy, &solved, step.solved_resident, sizeof solved);
    const double* gains = ctx_.on_host(gains_, gain_count(), w.sums);
    const double* b = ctx_.on_host(s.b, n, w.b);
    const double* H = damping.scaled ? ctx_.on_host(s.H, triangles, w.matrix) : nullptr;
    ctx_.synchronize();  // once for all
    const double predicted = detail::dot_in_order(x, b, n, detail::sum_in_order(gains, gain_count()));
    return {solved != 0, step.iterations, detail::damped_square<D>(damping, H, x, n, predicted)};
  }
  std::size_t gain_count() const { return static_cast<std::size_t>(landmark_gain_count(data_.structure.landmarks)); }

  /// An iteration from this cost that gains less is the last one.
  double ending_gain(double cost) const {
    return slow_ + 1 >= options_.slow_iterations ? options_.min_relative_decrease * cost : 0;
  }
  bool stopped() const { return options_.stop(); }
  bool out_of_time() const {
    return options_.time_budget_ms > 0 &&
           std::chrono::duration<double, std::milli>(clock::now() - start_).count() > options_.time_budget_ms;
  }
  context<Policy>& ctx_;
  Data& data_;
  const adjustment_options& options_;
  clock::time_point start_;
  tracked_equations<Policy, Data, G, A> equations_;
  adjustment_summary summary_;
  double* gains_ = nullptr;
  double* next_lambda_ = nullptr;
  reduced_step next_step_;     ///< solved for ahead
  double next_damping_ = NAN;  ///< with this damping, which the policy found
  bool solved_ = false;        ///< next_step_ is the one that is to be taken
  int slow_ = 0;               ///< iterations on end that gained little
  bool hopeful_ = true;        ///< the last step was accepted, so the next one probably is
  double largest_ = -1;        ///< of the diagonal, at the first look; -1: not looked at
};

/// Adjusts a problem: moves its free frames and landmarks to where the sum of rho(chi2) of all factors is least. One
/// iteration is one linearisation with all its retries. The same input gives the same bits, run by run, for any host policy
/// and any number of threads; but for last bits where the adjustment before, of the same object, began with a step that was
/// refused (docs/adjustment.md).
/// \tparam Methods  the solvers and precisions that the options may ask for (methods.hpp); only these are compiled
/// \return what happened; where no step was accepted the estimate is to the bit what was given
/// \throws std::invalid_argument  an option is out of range, or asks for what is not among Methods
template <class Methods = adjustment_methods<>, class Policy, class Frame, class... Groups>
adjustment_summary adjust(context<Policy>& ctx, basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>& problem,
                          const adjustment_options& options = {}) {
  using solvers = typename Methods::solvers;
  using precisions = typename Methods::precisions;
  using data = problem_data<memory_of_t<Policy>, Frame, Groups...>;
  const named_range range("adjust");
  detail::require_options<Methods>(options);
  if constexpr (precisions::has(precision::float64))
    if (options.numbers == precision::float64)
      return levenberg_marquardt<Policy, data, double, double>(ctx, problem.data(), options).template run<solvers>();
  if constexpr (precisions::has(precision::mixed))
    if (options.numbers == precision::mixed)
      return levenberg_marquardt<Policy, data, double, float>(ctx, problem.data(), options).template run<solvers>();
  if constexpr (precisions::has(precision::float32))
    if (options.numbers == precision::float32)
      return levenberg_marquardt<Policy, data, float, float>(ctx, problem.data(), options).template run<solvers>();
  return {};  // not reached: require_options() has thrown
}

#define TURBOMAP_INSTANTIATE(Camera, Policy)                                                           \
  TURBOMAP_INSTANCE adjustment_summary adjust<adjustment_methods<>>(                                   \
      context<Policy>&, basic_bundle_problem<memory_of_t<Policy>, pose_frame, reprojections<Camera>>&, \
      const adjustment_options&);
TURBOMAP_PRECOMPILED_ADJUSTMENTS(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE
