// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The normal equations of a problem, and of which estimate they are: the current one or the trial. An estimate is often evaluated
/// and linearised in one pass, before it is known whether the step there is accepted; this remembers what need not be computed
/// again.

#include "../config.hpp"
#include "../context.hpp"
#include "normal_equations.hpp"
#include "step_sums.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// \tparam Data  a problem_data
/// \tparam G     numbers of residuals   \tparam A  numbers of the normal equations of landmarks
template <class Policy, class Data, class G, class A>
class tracked_equations {
  using estimate = estimate_view<typename Data::frame>;

 public:
  /// Those of no estimate yet. Both must outlive this.
  tracked_equations(context<Policy>& ctx, Data& data) : ctx_(ctx), data_(data), equations_(ctx, data) {}

  /// As they were left.
  normal_equations<Data, G, A>& now() { return equations_; }
  /// Whether they are those of the current estimate.
  bool formed() const { return formed_ && place_ == at_current; }

  /// Those of the current estimate, unless they are there.
  void linearise() {
    const estimate x = data_.estimate.current();
    if (place_ != at_current) equations_.linearise(ctx_, x), formed_ = false;
    if (!formed_) equations_.form(ctx_, x);
    place_ = at_current, formed_ = true;
  }
  /// The cost of an estimate. \param ahead  it is likely to be linearised next: in the same pass, where that is cheap
  double evaluate(const estimate& x, bool ahead) {
    if (const step_report* report = evaluate_step(x, {}, ahead, [&] { equations_.form(ctx_, x); })) return report->cost;
    if (!Data::reprojections_only || !ahead) return equations_.evaluate(ctx_, x);
    note(x, false);
    return equations_.linearise_and_evaluate(ctx_, x);
  }
  /// The same of a step, where the policy sums. \param next  next() enqueues normal_equations::form(), or that and more
  /// \return null: the policy does not
  template <class Next>
  const step_report* evaluate_step(const estimate& x, const step_parts& parts, bool ahead, const Next& next) {
    const step_report* report = equations_.evaluate_step(ctx_, x, parts, ahead, next);
    if (report != nullptr && ahead) note(x, true);
    return report;
  }
  /// The trial becomes the current estimate.
  void accept() {
    place_ = place_ == at_trial ? at_current : nowhere;
    formed_ = formed_ && place_ == at_current;
    data_.estimate.accept();
  }

 private:
  void note(const estimate& x, bool formed) {
    place_ = x.states == data_.estimate.current().states ? at_current : at_trial;
    formed_ = formed;
  }

  context<Policy>& ctx_;
  Data& data_;
  normal_equations<Data, G, A> equations_;
  enum { nowhere, at_current, at_trial } place_ = nowhere;  ///< of the last linearisation
  bool formed_ = false;                                     ///< the normal equations are those of it
};

TURBOMAP_END_NAMESPACE
