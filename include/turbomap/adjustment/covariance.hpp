// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How uncertain frames are, the landmarks' uncertainty included: their covariance at the current estimate.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "linear_solver.hpp"
#include "normal_equations.hpp"
#include "options.hpp"
#include "problem.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Covariance of frames from a factorised reduced system: the columns of its inverse that they ask for.
template <class Problem>
class covariance_solver {
  static constexpr int V = Problem::landmark_dof, D = Problem::dof;

 public:
  template <class Policy>
  static bool run(context<Policy>& ctx, Problem& problem, span<const std::int32_t> frames, double tolerance,
                  int dense_limit, std::vector<double>& result) {
    if (problem.observation_count() == 0 || !problem.finite_) return false;
    const auto& structure = problem.structure();
    normal_equations<Problem, double, double> equations(problem);
    ctx.begin_call();
    equations.take_memory(ctx);
    equations.find_blocks(ctx);
    equations.linearise(ctx);
    const schur_view<double>& s = equations.view();
    for_each_index(ctx.policy(), structure.landmarks, eliminate_landmarks<double, V>{s, damping{0}});
    if (structure.free_frames * D <= dense_limit)
      return invert(ctx, dense_reduced_solver<double, V, D, Policy>(ctx, s, problem.workspace_), structure, frames,
                    tolerance, result);
    return invert(ctx,
                  sparse_reduced_solver<double, V, D, Policy>(ctx, s, structure.block_row, structure.block_column,
                                                              problem.workspace_),
                  structure, frames, tolerance, result);
  }

 private:
  template <class Policy, class Solver>
  static bool invert(context<Policy>& ctx, Solver solver, const adjustment_structure& structure,
                     span<const std::int32_t> frames, double tolerance, std::vector<double>& result) {
    if (!solver.factorise(ctx, damping{0}, tolerance)) return false;
    const auto free_of = [&](std::size_t i) { return structure.free_of_frame[static_cast<std::size_t>(frames[i])]; };
    const std::size_t n = frames.size() * D;
    result.assign(n * n, 0);
    std::vector<double> x(solver.padded_size());
    for (std::size_t c = 0; c < n; ++c) {
      if (free_of(c / D) < 0) continue;
      std::fill(x.begin(), x.end(), 0.0);
      x[static_cast<std::size_t>(free_of(c / D)) * D + c % D] = 1;
      solver.substitute(x.data());
      for (std::size_t r = 0; r < n; ++r)
        if (free_of(r / D) >= 0) result[r * n + c] = x[static_cast<std::size_t>(free_of(r / D)) * D + r % D];
    }
    return true;
  }
};

/// Joint covariance of some frames of a problem at its current estimate, all other frames and the landmarks
/// marginalised: the inverse of J^T W J without damping, W with the weights of the robust kernels. Unknowns are those of
/// Frame::retract (pose_frame: rotation, rad, then translation, m, on the left of T_cw: in the camera's axes). It is true to
/// scale where the information of the observations is.
/// \param frames     places of frames in the input, in any order; a fixed one is known: its rows are 0
/// \param result     row-major, square, Frame::dof rows for each of `frames`, symmetric up to rounding
/// \param tolerance  a pivot below it times the diagonal element it came from: the problem does not tell
/// \return false: the problem does not determine its frames (nothing fixed, a frame without observations, numbers that
///         are not finite), and `result` is as it was
/// \throws std::invalid_argument  a frame that is not there, or a tolerance that is not in [0, 1)
/// O(linearisation + factorisation + dof frames unknowns^2); float64. [Triggs et al. 2000, 9.5]
template <class Policy, class Frame, class... Groups>
bool frame_covariance(context<Policy>& ctx, bundle_problem<Policy, Frame, Groups...>& problem,
                      span<const std::int32_t> frames, std::vector<double>& result, double tolerance = 1e-11) {
  for (std::size_t i = 0; i < frames.size(); ++i)
    require(frames[i] >= 0 && frames[i] < problem.frame_count(), "frames[i]", frames[i], "is not a frame");
  require(tolerance >= 0 && tolerance < 1, "tolerance", tolerance, "must be in [0, 1)");
  return covariance_solver<bundle_problem<Policy, Frame, Groups...>>::run(ctx, problem, frames, tolerance,
                                                                          adjustment_options{}.dense_limit, result);
}

TURBOMAP_END_NAMESPACE
