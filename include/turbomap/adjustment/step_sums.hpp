// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What adjust() judges a step by: the cost at the trial estimate and the decrease that the quadratic model promised. A policy
/// whose memory the host does not read may sum both where they are, and hand over these few numbers; then the host enqueues
/// what most likely comes next before it waits for them.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../memory.hpp"
#include "damping.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What a step is judged by.
struct step_report {
  double cost;       ///< of the trial estimate
  double undefined;  ///< observations without a projection there
  double predicted;  ///< the decrease that the quadratic model promises
  double solved;     ///< 0: the system had no solution, and the other numbers mean nothing
  double lambda;     ///< of the next step, if the policy was asked for it; NaN: none follows
};

/// What it is summed from, in the memory of the policy.
struct step_parts {
  const double* costs = nullptr;   ///< partial costs, then as many counts of what is not defined
  std::size_t cost_count = 0;      ///< partial costs
  const double* gains = nullptr;   ///< of the landmarks; null: there is no step, `predicted` is 0
  std::size_t gain_count = 0;      ///< of the landmarks
  const double* step = nullptr;    ///< of the free frames
  const double* b = nullptr;       ///< [free frame] negative gradient
  const double* H = nullptr;       ///< [free frame] lower triangle
  std::size_t unknowns = 0;        ///< of the free frames
  const double* solved = nullptr;  ///< null: it was
  turbomap::damping damping{0};    ///< of the step
  // For a step that is solved for before the host has judged this one:
  double* next_lambda = nullptr;  ///< where the policy writes damping_after(); null: it is not asked for
  damping_control control{};      ///< before this step
  double cost_before = 0;         ///< of the current estimate
  double least_predicted = 0;     ///< the host looks closer where no more was predicted
  double least_decrease = 0;      ///< the host ends the adjustment where this step gains less
};

/// The damping of the step after the one that was summed, by the rule of the host; NaN: it will be refused, or none follows.
TURBOMAP_HD inline double damping_after(const step_parts& s, double cost, double predicted, double solved) {
  damping_control control = s.control;
  const bool goes_on = solved != 0 && predicted > s.least_predicted &&
                       control.accepts(s.cost_before, cost, predicted) && !(s.cost_before - cost < s.least_decrease);
  return goes_on ? control.lambda : NAN;
}

/// Of the normal equations of the first linearisation.
struct survey_report {
  double largest;       ///< diagonal element
  double undetermined;  ///< unknowns of free frames that no factor depends on
};

/// A result in host memory that the policy can write, and whether it is there.
template <class Report>
struct awaited {
  Report report;       ///< the result
  std::int32_t ready;  ///< not 0: the report is there
};

/// Sums a step where the policy computes, into `to`, which wait_for() waits for. Only for policies whose memory the host does not
/// read: see cuda/sum_step.cuh. \tparam D  unknowns of a frame
template <int D, class Derived>
void launch_sum_step(const thrust::execution_policy<Derived>& policy, const step_parts& parts,
                     awaited<step_report>* to);

/// Looks at the first linearisation. \param diagonal  largest diagonal element of each landmark; null: not asked for
/// \param held  [free frame] masks of unknowns whose diagonal is not theirs (hold_unknowns.hpp); null: none
template <int D, class Derived>
void launch_survey_frames(const thrust::execution_policy<Derived>& policy, const double* diagonal, int landmarks,
                          const double* H, int free_frames, const std::uint32_t* held, awaited<survey_report>* to);

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/sum_step.cuh"
#endif
