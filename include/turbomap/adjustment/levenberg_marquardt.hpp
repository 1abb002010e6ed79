// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Bundle adjustment by Levenberg and Marquardt's method with Nielsen's rule for the damping: adjust().

#include <chrono>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "conjugate_gradients.hpp"
#include "damping.hpp"
#include "host_sums.hpp"
#include "linear_solver.hpp"
#include "normal_equations.hpp"
#include "options.hpp"
#include "problem.hpp"
#include "schur.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = frame: moves a free one by its step, copies a fixed one.
template <class Frame>
struct retract_frames {
  const std::int32_t* free_of_frame;
  const double* step;
  const typename Frame::template state<double>* from;
  typename Frame::template state<double>* to;
  TURBOMAP_HD void operator()(int f) const {
    const int free = free_of_frame[f];
    to[f] = free < 0 ? from[f]
                     : Frame::template retract<double>(from[f], step + static_cast<std::ptrdiff_t>(free) * Frame::dof);
  }
};

/// One adjustment of one problem in one set of numbers; adjust() runs it.
/// \tparam G  numbers of residuals  \tparam A  numbers of the normal equations
template <class Problem, class G, class A>
class levenberg_marquardt {
  using Frame = typename Problem::frame_type;
  static constexpr int V = Problem::landmark_dof, D = Problem::dof;
  using clock = std::chrono::steady_clock;
  using substitute = substitute_landmarks<A, V, D>;

 public:
  template <class Policy>
  static adjustment_summary run(context<Policy>& ctx, Problem& problem, const adjustment_options& options) {
    levenberg_marquardt lm(problem, options);
    ctx.begin_call();
    lm.equations_.take_memory(ctx);
    lm.gains_ = ctx.template scratch<double>(static_cast<std::size_t>(lm.gain_count()));
    lm.summary_.end = lm.loop(ctx);
    return std::move(lm.summary_);
  }

 private:
  levenberg_marquardt(Problem& problem, const adjustment_options& options)
      : problem_(problem), options_(options), equations_(problem), start_(clock::now()) {}

  template <class Policy>
  adjustment_end loop(context<Policy>& ctx) {
    if (problem_.observations_ == 0) return adjustment_end::no_observations;
    if (!problem_.finite_) return adjustment_end::not_finite;
    double cost = equations_.evaluate(ctx, problem_.current_);
    summary_.cost_initial = summary_.cost_final = cost;
    if (!detail::is_finite(cost)) return adjustment_end::not_finite;
    summary_.undefined = equations_.undefined();
    if (problem_.structure_.free_frames == 0 && !landmarks_move()) return adjustment_end::nothing_free;
    if (choose(false) != reduced_solver::pcg) equations_.find_blocks(ctx);
    const schur_view<A>& s = equations_.view();
    const auto& structure = problem_.structure_;
    switch (choose(true)) {
      case reduced_solver::pcg:
        return iterate(ctx, cost,
                       pcg_reduced_solver<A, V, D, Policy>(ctx, s, structure.landmarks, problem_.workspace_,
                                                           options_.pcg_tolerance, options_.pcg_max_iterations));
      case reduced_solver::sparse:
        return iterate(ctx, cost,
                       sparse_reduced_solver<A, V, D, Policy>(ctx, s, structure.block_row, structure.block_column,
                                                              problem_.workspace_));
      default:
        return iterate(ctx, cost, dense_reduced_solver<A, V, D, Policy>(ctx, s, problem_.workspace_));
    }
  }

  template <class Policy, class Solver>
  adjustment_end iterate(context<Policy>& ctx, double cost, Solver solver) {
    damping_control control{options_.initial_lambda};
    double& lambda = control.lambda;
    summary_.each.reserve(static_cast<std::size_t>(options_.max_iterations < 100 ? options_.max_iterations : 100));
    int slow = 0;
    for (int i = 0; i < options_.max_iterations; ++i) {
      if (stopped()) return adjustment_end::stopped;
      if (i > 0 && out_of_time()) return adjustment_end::time_budget;
      equations_.linearise(ctx);
      if (i == 0 && !(lambda > 0)) {
        const double largest = equations_.largest_diagonal(ctx);
        lambda = options_.initial_lambda_scale * (options_.damping == damping_rule::diagonal ? 1 : largest);
        if (!(largest > 0)) return adjustment_end::converged;  // no factor depends on anything
      }
      ++summary_.iterations;
      adjustment_iteration it{cost, lambda, 0, 0};
      bool accepted = false, factorised = false;
      adjustment_end end = adjustment_end::no_descent;
      while (!accepted && it.steps <= options_.max_retries) {
        ++it.steps, it.lambda = lambda;
        double predicted = 0;
        const reduced_step step = take_step(ctx, solver, lambda, predicted);
        it.linear_iterations += step.iterations;
        if (step.solved) {
          factorised = true;
          if (!(predicted > options_.min_predicted_decrease * cost) && detail::is_finite(predicted)) {
            end = adjustment_end::converged;
            break;
          }
          const double after = equations_.evaluate(ctx, 1 - problem_.current_);
          if (control.accepts(cost, after, predicted)) {
            accepted = true;
            slow = cost - after < options_.min_relative_decrease * cost ? slow + 1 : 0;
            cost = after;
            summary_.undefined = equations_.undefined();
            problem_.current_ = 1 - problem_.current_;
            ++summary_.accepted;
            continue;
          }
        } else {
          control.refuse();
        }
        if (!detail::is_finite(lambda)) break;
        if (stopped()) {
          end = adjustment_end::stopped;
          break;
        }
      }
      it.cost = summary_.cost_final = cost;
      summary_.each.push_back(it);
      if (!accepted) return end == adjustment_end::no_descent && !factorised ? adjustment_end::singular : end;
      if (options_.min_relative_decrease > 0 && slow >= options_.slow_iterations) return adjustment_end::converged;
    }
    return adjustment_end::max_iterations;
  }

  bool stopped() const { return options_.stop != nullptr && options_.stop->load(std::memory_order_relaxed); }
  bool out_of_time() const {
    return options_.time_budget_ms > 0 &&
           std::chrono::duration<double, std::milli>(clock::now() - start_).count() > options_.time_budget_ms;
  }
  bool landmarks_move() const {
    if (!problem_.has_fixed_landmarks_) return problem_.structure_.rows() > 0;
    const auto& row = problem_.structure_.landmark_row;
    const auto& fixed = problem_.landmark_fixed_.host();
    for (std::size_t l = 0; l < fixed.size(); ++l)
      if (fixed[l] == 0 && row[l + 1] > row[l]) return true;
    return false;
  }

  /// Solves for a step with a damping and applies it to the other estimate. `predicted`: the decrease that the
  /// quadratic model promises, the sum of dx (damping dx + b).
  template <class Policy, class Solver>
  reduced_step take_step(context<Policy>& ctx, Solver& solver, double lambda, double& predicted) {
    const damping damping{lambda, options_.damping == damping_rule::diagonal};
    const schur_view<A>& s = equations_.view();
    for_each_index(ctx.policy(), landmarks(), eliminate_landmarks<A, V>{s, damping});
    double *x = nullptr, *host_x = nullptr;
    const reduced_step step = solver.solve(ctx, damping, x, host_x);
    if (!step.solved) return step;
    const int from = problem_.current_, to = 1 - from, frames = problem_.structure_.frames;
    for_each_index(ctx.policy(), gain_count(),
                   substitute{s, x, damping, problem_.landmarks_[from].data(), problem_.landmarks_[to].data(), gains_,
                              landmarks()});
    for_each_index(ctx.policy(), frames,
                   retract_frames<Frame>{problem_.free_of_frame_.data(), x, problem_.states_[from].data(),
                                         problem_.states_[to].data()});
    for_each_index(ctx.policy(), frames, prepare_poses<Frame>{problem_.states_[to].data(), problem_.poses_[to].data()});
    auto& buffer = problem_.workspace_.sums;
    const double* gains = on_host(ctx, gains_, static_cast<std::size_t>(gain_count()), buffer);
    predicted = detail::sum_in_order(gains, static_cast<std::size_t>(gain_count()));
    const std::size_t n = static_cast<std::size_t>(s.free_frames) * D;
    predicted = detail::dot_in_order(host_x, on_host(ctx, s.b, n, buffer), n, predicted);
    const double* H = nullptr;
    if (damping.scaled)
      H = on_host(ctx, s.H, static_cast<std::size_t>(s.free_frames) * frame_block<D>::triangle, buffer);
    predicted = detail::damped_square<D>(damping, H, host_x, n, predicted);
    return step;
  }
  int landmarks() const { return problem_.structure_.landmarks; }
  int gain_count() const { return (landmarks() + substitute::landmarks_an_index - 1) / substitute::landmarks_an_index; }

  /// The solver `automatic` stands for. A matrix with few empty blocks gains nothing from sparsity.
  reduced_solver choose(bool blocks_known) const {
    const int unknowns = problem_.structure_.free_frames * D;
    if (options_.solver != reduced_solver::automatic) return options_.solver;
    if (unknowns <= options_.dense_limit) return reduced_solver::dense;
    if (unknowns > options_.sparse_limit) return reduced_solver::pcg;
    const double f = problem_.structure_.free_frames,
                 blocks = static_cast<double>(problem_.structure_.block_row.size());
    return blocks_known && blocks > options_.sparse_fill * f * f / 2 ? reduced_solver::pcg : reduced_solver::sparse;
  }

  Problem& problem_;
  const adjustment_options& options_;
  normal_equations<Problem, G, A> equations_;
  clock::time_point start_;
  adjustment_summary summary_;
  double* gains_ = nullptr;
};

/// Adjusts a problem: moves its free frames and landmarks to where the sum of rho(chi2) of all factors is least.
/// Levenberg-Marquardt (one iteration = one linearisation with all its retries), landmarks eliminated by the Schur
/// complement. The same input gives the same bits, run by run and for any number of threads.
/// \return what happened; where no step was accepted the estimate is to the bit what was given
/// \throws std::invalid_argument  an option is out of range
template <class Policy, class Frame, class... Groups>
adjustment_summary adjust(context<Policy>& ctx, bundle_problem<Policy, Frame, Groups...>& problem,
                          const adjustment_options& options = {}) {
  require(options.max_iterations >= 0, "options.max_iterations", options.max_iterations, "must not be negative");
  require(options.max_retries >= 0, "options.max_retries", options.max_retries, "must not be negative");
  require(options.initial_lambda >= 0 && detail::is_finite(options.initial_lambda), "options.initial_lambda",
          options.initial_lambda, "must be finite and not negative");
  require(options.initial_lambda_scale > 0 && detail::is_finite(options.initial_lambda_scale),
          "options.initial_lambda_scale", options.initial_lambda_scale, "must be finite and positive");
  require(options.min_relative_decrease >= 0, "options.min_relative_decrease", options.min_relative_decrease,
          "must not be negative");
  require(options.slow_iterations > 0, "options.slow_iterations", options.slow_iterations, "must be positive");
  require(options.pcg_tolerance > 0, "options.pcg_tolerance", options.pcg_tolerance, "must be positive");
  require(options.pcg_max_iterations > 0, "options.pcg_max_iterations", options.pcg_max_iterations, "must be positive");
  using problem_type = bundle_problem<Policy, Frame, Groups...>;
  switch (options.numbers) {
    case precision::mixed:
      return levenberg_marquardt<problem_type, double, float>::run(ctx, problem, options);
    case precision::float32:
      return levenberg_marquardt<problem_type, float, float>::run(ctx, problem, options);
    default:
      return levenberg_marquardt<problem_type, double, double>::run(ctx, problem, options);
  }
}

TURBOMAP_END_NAMESPACE
