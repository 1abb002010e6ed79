// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The cost of a problem and its normal equations at an estimate, in memory of the context.

#include <cstddef>
#include <tuple>
#include <type_traits>

#include "../config.hpp"
#include "../context.hpp"
#include "../math/pack.hpp"
#include "eliminate_landmarks.hpp"
#include "frame_sums.hpp"
#include "hold_unknowns.hpp"
#include "host_sums.hpp"
#include "list_blocks.hpp"
#include "problem_data.hpp"
#include "schur_view.hpp"
#include "step_sums.hpp"
#include "uploaded.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// \tparam Data  a problem_data
/// \tparam G     numbers of residuals   \tparam A  numbers of the normal equations of landmarks
template <class Data, class G, class A>
class normal_equations {
  using Frame = typename Data::frame;
  static constexpr int V = Data::landmark_dof, D = Data::dof;

 public:
  /// Takes everything that is computed in from the context: no allocation in the steady state.
  template <class Policy>
  normal_equations(context<Policy>& ctx, Data& data) : data_(data) {
    const adjustment_structure& s = data.structure;
    const auto at = [](int i) { return static_cast<std::size_t>(i); };
    data.lists.point(s_);
    s_.free_frames = s.free_frames, s_.landmarks = s.landmarks;
    s_.landmark_fixed = data.landmark_fixed.host().empty() ? nullptr : data.landmark_fixed.data();
    s_.sums.row = columns(ctx, s.rows() * landmark_block<V>::row);
    if constexpr (!from_rows) {
      s_.sums.coupling = columns(ctx, s.couplings() * landmark_block<V>::coupling);
    } else if constexpr (on_the_host<Policy>) {
      axes_ = ctx.template scratch<A>(at(s.free_frames) * 6 * column_lanes<V>);
      centres_ = ctx.template scratch<double>(at(s.free_frames) * landmark_stride);
      s_.axes = axes_, s_.centres = centres_;
      if constexpr (compact_form<A, V, D>) s_.turned = ctx.template scratch<double>(at(s.free_frames) * turned_stride);
    } else {
      s_.held = data.held_masks();
    }
    s_.eliminated = columns(ctx, s.slots() * landmark_block<V>::coupling);
    s_.sums.chunk_partial = ctx.template scratch<double>(at(s.partials) * landmark_block<V>::partial);
    s_.sums.factor_partial = ctx.template scratch<double>(at(s.factor_partials) * frame_block<D>::partial);
    s_.sums.factor_square = ctx.template scratch<double>(s.frame_pairs.size() * frame_block<D>::square);
    s_.landmark = ctx.template scratch<eliminated_landmark>(at(s.landmarks));
    s_.H = ctx.template scratch<double>(at(s.free_frames) * frame_block<D>::triangle);
    s_.b = ctx.template scratch<double>(at(s.free_frames) * D);
    costs_ = ctx.template scratch<double>(2 * s.costs());
    scales_ = ctx.template scratch<double>(at(s.landmarks));
    data.workspace.report.resize_discard(1), data.workspace.survey.resize_discard(1);
  }

  /// Where the solvers look.
  const schur_view<A>& view() const { return s_; }
  /// Of the last evaluate(): observations without a projection.
  int undefined() const { return undefined_; }

  /// The lists of the blocks of the reduced matrix: for the solvers that form it.
  /// \param full  every block has its place in the matrix, those that are empty too
  template <class Policy>
  void need_blocks(context<Policy>& ctx, bool full) {
    s_.compact = from_rows && on_the_host<Policy> && compact_form<A, V, D>;
    if (full && launch_list_blocks(ctx.policy(), ctx.scratch(), data_.structure, s_)) return;
    data_.need_blocks(ctx.policy());
    data_.lists.point(s_);
    s_.blocks = static_cast<int>(data_.structure.block_row.size());
  }

  /// The robust cost of an estimate, and undefined(). Summed in one order.
  template <class Policy>
  double evaluate(context<Policy>& ctx, const estimate_view<Frame>& x) {
    compute_costs(ctx, x);
    return sum_costs(ctx);
  }

  /// The same and, where the policy hands over sums, those of a step that led there.
  /// \param parts  of the step; costs are filled in here
  /// \param ahead  the estimate is likely to be linearised next: that and next() are enqueued before the host waits
  /// \param next   enqueues form(), or that and more
  /// \return null: the policy does not
  template <class Policy, class Next>
  const step_report* evaluate_step(context<Policy>& ctx, const estimate_view<Frame>& x,
                                   [[maybe_unused]] step_parts parts, [[maybe_unused]] bool ahead,
                                   [[maybe_unused]] Next next) {
    if constexpr (is_host_accessible_v<memory_of_t<Policy>>) {
      return nullptr;
    } else {
      auto* const to = data_.workspace.report.data();
      if (!can_hand_over(to)) return nullptr;
      parts.costs = costs_, parts.cost_count = data_.structure.costs();
      if (ahead && Data::reprojections_only)
        linearise(ctx, x, costs());
      else
        compute_costs(ctx, x);
      launch_sum_step<D>(ctx.policy(), parts, to);
      if (ahead && !Data::reprojections_only) linearise(ctx, x);
      if (ahead) next();
      const step_report& report = wait_for(ctx.policy(), *to);
      undefined_ = static_cast<int>(report.undefined);
      return &report;
    }
  }

  /// Linearises all factors at an estimate: rows, couplings and partial sums. form() sums them.
  template <class Policy>
  void linearise(context<Policy>& ctx, const estimate_view<Frame>& x) {
    linearise(ctx, x, {nullptr, nullptr});
  }
  /// The same, and evaluate().
  template <class Policy>
  double linearise_and_evaluate(context<Policy>& ctx, const estimate_view<Frame>& x) {
    linearise(ctx, x, costs());
    return sum_costs(ctx);
  }

  /// The normal equations of what was linearised, at the estimate that it was linearised at.
  template <class Policy>
  void form(context<Policy>& ctx, const estimate_view<Frame>& x) {
    launch_sum_frames<V, D>(ctx.policy(), s_);
    finish(ctx, x);
  }
  /// The same, and eliminates the landmarks with a damping that the policy knows by then. Only where couplings are made of rows,
  /// and not on the host. \param lambda  see schur_view
  template <class Policy>
  void form_and_eliminate(context<Policy>& ctx, const estimate_view<Frame>& x, const damping& damping,
                          const double* lambda) {
    s_.positions = x.landmarks, s_.poses = x.poses, s_.lambda = lambda;
    launch_sum_and_eliminate<V, D>(ctx.policy(), s_, damping);
    s_.lambda = nullptr;
    finish(ctx, x);
  }

  /// undetermined() and largest_diagonal(), where the policy hands them over. Null: it does not.
  /// \param scale  whether the largest element is asked for
  template <class Policy>
  const survey_report* survey(context<Policy>& ctx, bool scale) {
    if constexpr (is_host_accessible_v<memory_of_t<Policy>>) {
      return nullptr;
    } else {
      auto* const to = data_.workspace.survey.data();
      if (!can_hand_over(to)) return nullptr;
      if (scale) launch_scale_landmarks(ctx.policy(), s_, scales_);
      launch_survey_frames<D>(ctx.policy(), scale ? scales_ : nullptr, s_.landmarks, s_.H, s_.free_frames,
                              data_.held_masks(), to);
      return &wait_for(ctx.policy(), *to);
    }
  }

  /// Unknowns of free frames that no factor depends on.
  template <class Policy>
  int undetermined(context<Policy>& ctx) {
    constexpr int triangle = frame_block<D>::triangle;
    const double* H = on_host(ctx, s_.H, static_cast<std::size_t>(s_.free_frames) * triangle, data_.workspace.sums);
    int count = 0;
    for (int f = 0; f < s_.free_frames; ++f)
      for (int i = 0; i < D; ++i) count += H[f * triangle + i * (i + 3) / 2] > 0 ? 0 : 1;
    return count;
  }

  /// The largest diagonal element of all blocks of frames and landmarks. Not of unknowns that are held: theirs is 1, in no unit.
  template <class Policy>
  double largest_diagonal(context<Policy>& ctx) {
    launch_scale_landmarks(ctx.policy(), s_, scales_);
    double largest = 0;
    auto& buffer = data_.workspace.sums;
    const double* d = on_host(ctx, scales_, static_cast<std::size_t>(s_.landmarks), buffer);
    for (int l = 0; l < s_.landmarks; ++l) largest = larger(d[l], largest);
    constexpr int triangle = frame_block<D>::triangle;
    const double* H = on_host(ctx, s_.H, static_cast<std::size_t>(s_.free_frames) * triangle, buffer);
    const auto& held = data_.held.host();
    for (int f = 0; f < s_.free_frames; ++f)
      for (int i = 0; i < D; ++i)
        if (held.empty() || (held[static_cast<std::size_t>(f)] >> i & 1U) == 0)
          largest = larger(H[f * triangle + i * (i + 1) / 2 + i], largest);
    return largest;
  }

  /// What is left to gain, whatever the damping: the sum of b^2 / h over all unknowns, h being the diagonal of H. 0 at an
  /// optimum; free of the units of the unknowns.
  template <class Policy>
  double gradient_gain(context<Policy>& ctx) {
    launch_measure_gains(ctx.policy(), s_, scales_);
    const auto landmarks = static_cast<std::size_t>(s_.landmarks), frames = static_cast<std::size_t>(s_.free_frames);
    auto& w = data_.workspace;
    const double gain = detail::sum_in_order(on_host(ctx, scales_, landmarks, w.sums), landmarks);
    const double* b = on_host(ctx, s_.b, frames * D, w.sums);
    return detail::gain_in_order<D>(on_host(ctx, s_.H, frames * frame_block<D>::triangle, w.matrix), b, frames * D,
                                    gain);
  }

 private:
  /// What form() does after the sums.
  template <class Policy>
  void finish(context<Policy>& ctx, const estimate_view<Frame>& x) {
    s_.positions = x.landmarks, s_.poses = x.poses;
    if constexpr (from_rows && on_the_host<Policy>)
      launch_prepare_axes<V>(ctx.policy(), data_.structure.frames, s_.free_of_frame, x.poses, data_.held_masks(), axes_,
                             centres_);
    if constexpr (D <= 32)
      if (data_.held_masks() != nullptr)
        launch_hold_unknowns<V, D>(ctx.policy(), s_, data_.held_masks(), static_cast<int>(data_.structure.slots()));
  }
  /// n numbers and column_slack more: zeros on the host, whose lanes beyond the last column read them.
  template <class Policy>
  static A* columns(context<Policy>& ctx, std::size_t n) {
    A* const to = ctx.template scratch<A>(n + column_slack);
    if constexpr (is_host_accessible_v<memory_of_t<Policy>>)
      fill_bytes(ctx.policy(), to + n, 0, column_slack * sizeof(A));
    return to;
  }
  cost_sums costs() const { return {costs_, costs_ + data_.structure.costs()}; }

  template <class Policy>
  void compute_costs(context<Policy>& ctx, const estimate_view<Frame>& x) {
    std::apply([&](auto&... g) { (g.template cost<G>(ctx.policy(), x, costs()), ...); }, data_.groups);
  }
  template <class Policy>
  double sum_costs(context<Policy>& ctx) {
    const std::size_t n = data_.structure.costs();
    const double* c = on_host(ctx, costs_, 2 * n, data_.workspace.sums);
    undefined_ = static_cast<int>(detail::sum_in_order(c + n, n));
    return detail::sum_in_order(c, n);
  }
  template <class Policy>
  void linearise(context<Policy>& ctx, const estimate_view<Frame>& x, const cost_sums& costs) {
    std::apply([&](auto&... g) { (g.template linearise<G>(ctx.policy(), x, s_.sums, costs), ...); }, data_.groups);
  }

  /// Whether couplings are made of rows (row_couplings.hpp).
  static constexpr bool from_rows = Data::reprojections_only;
  template <class Policy>
  static constexpr bool on_the_host = is_host_accessible_v<memory_of_t<Policy>>;

  Data& data_;
  schur_view<A> s_{};
  A* axes_ = nullptr;
  double* centres_ = nullptr;
  double *costs_ = nullptr, *scales_ = nullptr;
  int undefined_ = 0;
};

TURBOMAP_END_NAMESPACE
