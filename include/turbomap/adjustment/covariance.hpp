// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How uncertain frames are, the landmarks' uncertainty included: their covariance at the current estimate.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "cholesky_solver.hpp"
#include "eliminate_landmarks.hpp"
#include "normal_equations.hpp"
#include "options.hpp"
#include "problem.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The columns of the inverse of a factorised reduced system that some frames ask for. False: singular.
template <int D, class Policy, class Solver, class List>
bool invert_columns(context<Policy>& ctx, Solver solver, const adjustment_structure& structure,
                    span<const std::int32_t> frames, double tolerance, List& result) {
  if (!solver.factorise(ctx, damping{0}, tolerance)) return false;
  const auto free_of = [&](std::size_t i) { return structure.free_of_frame[static_cast<std::size_t>(frames[i])]; };
  const std::size_t n = frames.size() * D;
  result.assign(n * n, 0);
  plain_vector<double> x(solver.unknowns());
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

}  // namespace detail

/// Joint covariance of some frames of a problem at its current estimate, all other frames and the landmarks marginalised:
/// the inverse of J^T W J without damping, W with the weights of the robust kernels. Unknowns are those of Frame::retract
/// (pose_frame: rotation, rad, then translation, m, on the left of T_cw: in the axes of the camera). It is true to scale
/// where the information of the observations is.
/// \param frames     places of frames in the input, in any order; a fixed one is known: its rows are 0
/// \param result     row-major, square, Frame::dof rows for each of `frames`, symmetric up to rounding
/// \param tolerance  a pivot below it times the diagonal element it came from: the problem does not tell
/// \return false: the problem does not determine its frames (nothing fixed, a frame without observations, numbers that
///         are not finite), and `result` is as it was
/// \throws std::invalid_argument  a frame that is not there, or a tolerance that is not in [0, 1)
/// O(linearisation + factorisation + dof frames unknowns^2); float64. [Triggs et al. 2000, 9.5]
template <class Policy, class Frame, class... Groups, class List>
bool frame_covariance(context<Policy>& ctx, basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>& problem,
                      span<const std::int32_t> frames, List& result, double tolerance = 1e-11) {
  for (std::size_t i = 0; i < frames.size(); ++i)
    require(frames[i] >= 0 && frames[i] < problem.frame_count(), "frames[i]", frames[i], "is not a frame");
  require(tolerance >= 0 && tolerance < 1, "tolerance", tolerance, "must be in [0, 1)");

  auto& data = problem.data();
  if (data.observations == 0 || !data.finite) return false;
  constexpr int V = Frame::landmark_dof, D = Frame::dof;
  ctx.begin_call();
  normal_equations<std::decay_t<decltype(data)>, double, double> equations(ctx, data);
  equations.need_blocks(ctx);
  equations.linearise(ctx);
  const schur_view<double>& s = equations.view();
  launch_eliminate_landmarks<V>(ctx.policy(), s, damping{0});
  const auto invert = [&](auto solver) {
    return detail::invert_columns<D>(ctx, std::move(solver), data.structure, frames, tolerance, result);
  };
  if (s.free_frames * D <= adjustment_options{}.dense_limit)
    return invert(cholesky_solver<double, V, D, dense_system<D>>(ctx, s, data.structure, data.workspace));
  return invert(cholesky_solver<double, V, D, sparse_system<D>>(ctx, s, data.structure, data.workspace));
}

TURBOMAP_END_NAMESPACE
