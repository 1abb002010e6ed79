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
#include "linear_solver.hpp"
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
  using memory = typename Problem::memory;
  static constexpr int V = Problem::landmark_dof, D = Problem::dof;
  using clock = std::chrono::steady_clock;

 public:
  template <class Policy>
  static adjustment_summary run(context<Policy>& ctx, Problem& problem, const adjustment_options& options) {
    levenberg_marquardt lm(problem, options);
    ctx.begin_call();
    lm.take_memory(ctx);
    lm.summary_.end = lm.loop(ctx);
    return std::move(lm.summary_);
  }

 private:
  levenberg_marquardt(Problem& problem, const adjustment_options& options)
      : problem_(problem), options_(options), start_(clock::now()) {}

  template <class Policy>
  adjustment_end loop(context<Policy>& ctx) {
    const auto& structure = problem_.structure_;
    if (problem_.observations_ == 0) return adjustment_end::no_observations;
    if (!problem_.finite_) return adjustment_end::not_finite;
    double cost = evaluate(ctx, problem_.current_);
    summary_.cost_initial = summary_.cost_final = cost;
    if (!detail::is_finite(cost)) return adjustment_end::not_finite;
    summary_.undefined = undefined_;
    if (structure.free_frames == 0 && !landmarks_move()) return adjustment_end::nothing_free;
    if (choose(false) != reduced_solver::pcg) {
      problem_.find_blocks();
      problem_.send_blocks(ctx.policy());
      view_blocks();
    }
    switch (choose(true)) {
      case reduced_solver::pcg:
        return iterate(ctx, cost,
                       pcg_reduced_solver<A, V, D, Policy>(ctx, s_, structure.landmarks, problem_.workspace_,
                                                           options_.pcg_tolerance, options_.pcg_max_iterations));
      case reduced_solver::sparse:
        return iterate(ctx, cost,
                       sparse_reduced_solver<A, V, D, Policy>(ctx, s_, structure.block_row, structure.block_column,
                                                              problem_.workspace_));
      default:
        return iterate(ctx, cost, dense_reduced_solver<A, V, D, Policy>(ctx, s_, problem_.workspace_));
    }
  }

  template <class Policy, class Solver>
  adjustment_end iterate(context<Policy>& ctx, double cost, Solver solver) {
    double lambda = options_.initial_lambda, growth = 2;
    int slow = 0;
    for (int i = 0; i < options_.max_iterations; ++i) {
      if (stopped()) return adjustment_end::stopped;
      if (i > 0 && out_of_time()) return adjustment_end::time_budget;
      linearise(ctx);
      if (i == 0 && !(lambda > 0)) {
        lambda = options_.initial_lambda_scale * largest_diagonal(ctx);
        if (!(lambda > 0)) return adjustment_end::converged;  // no factor depends on anything
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
          const double after = evaluate(ctx, 1 - problem_.current_), ratio = (cost - after) / predicted;
          if (detail::is_finite(after) && detail::is_finite(ratio) && ratio > 0) {
            accepted = true;
            const double x = 2 * ratio - 1, scale = 1 - x * x * x;
            lambda *= scale < 1.0 / 3 ? 1.0 / 3 : scale > 2.0 / 3 ? 2.0 / 3 : scale, growth = 2;
            slow = cost - after < options_.min_relative_decrease * cost ? slow + 1 : 0;
            cost = after;
            summary_.undefined = undefined_;
            problem_.current_ = 1 - problem_.current_;
            ++summary_.accepted;
            continue;
          }
        }
        lambda *= growth, growth *= 2;
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

  /// Everything that is computed in, from the context: no allocation in the steady state.
  template <class Policy>
  void take_memory(context<Policy>& ctx) {
    const auto& s = problem_.structure_;
    const std::size_t nf = static_cast<std::size_t>(s.free_frames), slack = 16;  // read beyond the last column
    const auto at = [](int i) { return static_cast<std::size_t>(i); };
    const auto lists = [&](int i) { return problem_.lists_[at(i)].data(); };
    s_.landmark_row = lists(0), s_.landmark_slot = lists(1), s_.slot_coupling = lists(2), s_.slot_frame = lists(3);
    s_.slot_landmark = lists(4), s_.frame_partial = lists(5), s_.partial_list = lists(6), s_.frame_slot = lists(7);
    s_.slot_list = lists(8), s_.frame_factor = lists(9), s_.frame_factor_list = lists(10);
    s_.frame_pair = lists(11), s_.frame_pair_list = problem_.neighbours_.data();
    s_.landmark_fixed = problem_.has_fixed_landmarks_ ? problem_.landmark_fixed_.data() : nullptr;
    s_.free_frames = s.free_frames;
    s_.row = sums_.row = ctx.template scratch<A>(s.rows() * 9 + slack);
    s_.coupling = sums_.coupling = ctx.template scratch<A>(s.couplings() * 3 * V + slack);
    s_.eliminated = ctx.template scratch<A>(s.slots() * 3 * V + slack);
    s_.chunk_partial = sums_.partial = ctx.template scratch<double>(at(s.partials) * landmark_block<V>::partial);
    s_.factor_partial = factor_partial_ =
        ctx.template scratch<double>(at(problem_.factor_partials_) * frame_block<D>::partial);
    s_.factor_square = factor_square_ = ctx.template scratch<double>(at(problem_.squares_) * frame_block<D>::square);
    s_.landmark = ctx.template scratch<eliminated_landmark>(at(s.landmarks));
    s_.H = ctx.template scratch<double>(nf * frame_block<D>::triangle);
    s_.b = ctx.template scratch<double>(nf * D);
    costs_ = ctx.template scratch<double>(2 * at(problem_.costs_));
    scales_ = ctx.template scratch<double>(at(s.landmarks));
  }
  void view_blocks() {
    const auto lists = [&](int i) {
      return problem_.lists_[static_cast<std::size_t>(Problem::first_block_list + i)].data();
    };
    s_.block_row = lists(0), s_.block_column = lists(1), s_.block_pair = lists(2), s_.block_factor = lists(3);
    s_.factor_list = lists(4), s_.pairs = problem_.pairs_.data();
    s_.blocks = static_cast<int>(problem_.structure_.block_row.size());
  }

  /// The robust cost of an estimate, and `undefined_`. Summed in one order.
  template <class Policy>
  double evaluate(context<Policy>& ctx, int which) {
    const std::size_t n = static_cast<std::size_t>(problem_.costs_);
    const auto x = problem_.estimate(which);
    std::apply([&](auto&... g) { (g.template cost<G>(ctx.policy(), x, costs_, costs_ + n), ...); }, problem_.groups_);
    const double* c = on_host(ctx, costs_, 2 * n, host_costs_);
    double total = 0, undefined = 0;
    for (std::size_t i = 0; i < n; ++i) total += c[i], undefined += c[n + i];
    undefined_ = static_cast<int>(undefined);
    return total;
  }

  template <class Policy>
  void linearise(context<Policy>& ctx) {
    const auto x = problem_.estimate(problem_.current_);
    std::apply(
        [&](auto&... g) { (g.template linearise<G, A>(ctx.policy(), x, sums_, factor_partial_, factor_square_), ...); },
        problem_.groups_);
    for_each_index(ctx.policy(), s_.free_frames, sum_frames<A, V, D>{s_});
  }

  template <class Policy>
  double largest_diagonal(context<Policy>& ctx) {
    const std::size_t landmarks = static_cast<std::size_t>(problem_.structure_.landmarks);
    for_each_index(ctx.policy(), problem_.structure_.landmarks, scale_of_landmarks<A>{s_, scales_});
    double largest = 0;
    const double* d = on_host(ctx, scales_, landmarks, host_costs_);
    for (std::size_t l = 0; l < landmarks; ++l) largest = larger(d[l], largest);
    constexpr int triangle = frame_block<D>::triangle;
    const double* H = on_host(ctx, s_.H, static_cast<std::size_t>(s_.free_frames) * triangle, host_costs_);
    for (int f = 0; f < s_.free_frames; ++f)
      for (int i = 0; i < D; ++i) largest = larger(H[f * triangle + i * (i + 1) / 2 + i], largest);
    return largest;
  }

  /// Solves for a step with a damping and applies it to the other estimate. `predicted`: the decrease that the
  /// quadratic
  /// model promises, the sum of dx (lambda dx + b).
  template <class Policy, class Solver>
  reduced_step take_step(context<Policy>& ctx, Solver& solver, double lambda, double& predicted) {
    const auto& s = problem_.structure_;
    for_each_index(ctx.policy(), s.landmarks, eliminate_landmarks<A, V>{s_, lambda});
    double *x = nullptr, *host_x = nullptr;
    const reduced_step step = solver.solve(ctx, lambda, x, host_x);
    if (!step.solved) return step;
    const int from = problem_.current_, to = 1 - from;
    using substitute = substitute_landmarks<A, V, D>;
    const int groups = (s.landmarks + substitute::landmarks_an_index - 1) / substitute::landmarks_an_index;
    for_each_index(ctx.policy(), groups,
                   substitute{s_, x, lambda, problem_.landmarks_[from].data(), problem_.landmarks_[to].data(), scales_,
                              s.landmarks});
    for_each_index(ctx.policy(), s.frames,
                   retract_frames<Frame>{problem_.free_of_frame_.data(), x, problem_.states_[from].data(),
                                         problem_.states_[to].data()});
    for_each_index(ctx.policy(), s.frames,
                   prepare_poses<Frame>{problem_.states_[to].data(), problem_.poses_[to].data()});
    const double* gains = on_host(ctx, scales_, static_cast<std::size_t>(groups), host_costs_);
    predicted = 0;
    for (int i = 0; i < groups; ++i) predicted += gains[i];
    const double* b = on_host(ctx, s_.b, static_cast<std::size_t>(s_.free_frames) * D, host_costs_);
    for (int i = 0; i < s_.free_frames * D; ++i) predicted += host_x[i] * (lambda * host_x[i] + b[i]);
    return step;
  }

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
  clock::time_point start_;
  adjustment_summary summary_;
  schur_view<A> s_{};
  landmark_sums<A> sums_{};
  double *factor_partial_ = nullptr, *factor_square_ = nullptr, *costs_ = nullptr, *scales_ = nullptr;
  std::vector<double> host_costs_;
  int undefined_ = 0;
};

/// Adjusts a problem: moves its free frames and landmarks to where the sum of rho(chi2) of all factors is least.
/// Levenberg-Marquardt (H + lambda I; one iteration = one linearisation with all its retries), landmarks eliminated by
/// the
/// Schur complement. The same input gives the same bits, run by run and for any number of threads.
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
