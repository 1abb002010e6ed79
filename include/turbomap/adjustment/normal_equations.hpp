// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The cost of a problem and its normal equations at an estimate, in memory of the context.

#include <cstddef>
#include <tuple>

#include "../config.hpp"
#include "../context.hpp"
#include "host_sums.hpp"
#include "linear_solver.hpp"
#include "problem.hpp"
#include "schur.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// \tparam G  numbers of residuals  \tparam A  numbers of the normal equations
template <class Problem, class G, class A>
class normal_equations {
  static constexpr int V = Problem::landmark_dof, D = Problem::dof;

 public:
  explicit normal_equations(Problem& problem) : problem_(problem) {}

  /// Where the solvers look.
  const schur_view<A>& view() const { return s_; }
  /// Of the last evaluate(): observations without a projection.
  int undefined() const { return undefined_; }

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

  /// The lists of the blocks of the reduced matrix: for the solvers that form it.
  template <class Policy>
  void find_blocks(context<Policy>& ctx) {
    problem_.find_blocks();
    problem_.send_blocks(ctx.policy());
    const auto lists = [&](int i) {
      return problem_.lists_[static_cast<std::size_t>(Problem::first_block_list + i)].data();
    };
    s_.block_row = lists(0), s_.block_column = lists(1), s_.block_pair = lists(2), s_.block_factor = lists(3);
    s_.factor_list = lists(4), s_.pairs = problem_.pairs_.data();
    s_.blocks = static_cast<int>(problem_.structure_.block_row.size());
  }

  /// The robust cost of an estimate, and undefined(). Summed in one order.
  template <class Policy>
  double evaluate(context<Policy>& ctx, int which) {
    const std::size_t n = static_cast<std::size_t>(problem_.costs_);
    const auto x = problem_.estimate(which);
    std::apply([&](auto&... g) { (g.template cost<G>(ctx.policy(), x, costs_, costs_ + n), ...); }, problem_.groups_);
    const double* c = on_host(ctx, costs_, 2 * n, problem_.workspace_.sums);
    undefined_ = static_cast<int>(detail::sum_in_order(c + n, n));
    return detail::sum_in_order(c, n);
  }

  /// At the current estimate.
  template <class Policy>
  void linearise(context<Policy>& ctx) {
    const auto x = problem_.estimate(problem_.current_);
    std::apply(
        [&](auto&... g) { (g.template linearise<G, A>(ctx.policy(), x, sums_, factor_partial_, factor_square_), ...); },
        problem_.groups_);
    for_each_index(ctx.policy(), s_.free_frames, sum_frames<A, V, D>{s_});
  }

  /// Of all blocks of frames and landmarks.
  template <class Policy>
  double largest_diagonal(context<Policy>& ctx) {
    const std::size_t landmarks = static_cast<std::size_t>(problem_.structure_.landmarks);
    for_each_index(ctx.policy(), problem_.structure_.landmarks, scale_of_landmarks<A>{s_, scales_});
    double largest = 0;
    const double* d = on_host(ctx, scales_, landmarks, problem_.workspace_.sums);
    for (std::size_t l = 0; l < landmarks; ++l) largest = larger(d[l], largest);
    constexpr int triangle = frame_block<D>::triangle;
    const double* H = on_host(ctx, s_.H, static_cast<std::size_t>(s_.free_frames) * triangle, problem_.workspace_.sums);
    for (int f = 0; f < s_.free_frames; ++f)
      for (int i = 0; i < D; ++i) largest = larger(H[f * triangle + i * (i + 1) / 2 + i], largest);
    return largest;
  }

 private:
  Problem& problem_;
  schur_view<A> s_{};
  landmark_sums<A> sums_{};
  double *factor_partial_ = nullptr, *factor_square_ = nullptr, *costs_ = nullptr, *scales_ = nullptr;
  int undefined_ = 0;
};

TURBOMAP_END_NAMESPACE
