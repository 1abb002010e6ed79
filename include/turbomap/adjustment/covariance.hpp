// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How uncertain frames are, the landmarks' uncertainty included: their covariance at the current estimate, and how many
/// directions nothing tells.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "information_sum.hpp"
#include "problem.hpp"
#include "profile_cholesky.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// What the residuals of a problem tell of its free frames: the matrix, factorised, and which unknowns it leaves open.
struct frame_information {
  profile_cholesky matrix;  ///< Frame::dof unknowns per free frame, in their order
  /// [unknown] 1: it takes part in a direction that nothing tells, or is the first of a frame with a residual that is not
  /// finite.
  plain_vector<std::uint8_t> undetermined;
};

/// Computes it, on the host.
template <class Policy, class Frame, class... Groups>
frame_information information_of(context<Policy>& ctx,
                                 basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>& problem,
                                 double tolerance) {
  require(tolerance >= 0 && tolerance < 1, "tolerance", tolerance, "must be in [0, 1)");
  constexpr int D = Frame::dof;
  auto& data = problem.data();
  if (problem.frame_count() == 0) return {};  // also where memory ran out, and lists of the problem before are left
  data.need_rows(ctx.policy());
  const adjustment_structure& s = data.structure;
  plain_vector<typename Frame::template state<double>> states;
  plain_vector<vec3<double>> given, landmarks;
  problem.frames(ctx, states), problem.landmarks(ctx, given);
  for (const auto l : data.order.source()) landmarks.push_back(given[static_cast<std::size_t>(l)]);
  residual_rows<D> rows;
  information_sum<D> observed;
  frame_information of;
  const auto& fixed = data.landmark_fixed.host();
  if (data.finite)
    std::apply([&](const auto&... g) { (g.list_rows(s, states.data(), landmarks.data(), rows), ...); }, data.groups);
  for (auto& l : rows.landmark)
    if (l >= 0 && !fixed.empty() && fixed[static_cast<std::size_t>(l)] != 0) l = -1;
  observed.build(rows, s.free_frames, s.landmarks, data.held.host(), of.matrix);
  of.matrix.factorise(tolerance, of.undetermined);
  for (const auto f : rows.spoilt) of.undetermined[static_cast<std::size_t>(f) * D] = 1;
  return of;
}

}  // namespace detail

/// How many directions of the free frames' unknowns nothing tells at the current estimate: the dimension of the null space
/// of the undamped normal equations, landmarks eliminated. Of a gauge that is free: 6, with one camera 7; of a heading: 1;
/// of an unknown that no factor depends on: 1. Damping alone keeps an adjustment from moving along them, and
/// adjustment_summary::undetermined counts only unknowns that nothing depends on at all. A factor whose residual or derivative
/// is not finite tells nothing; where a state or a measurement is not finite, nothing tells any unknown.
/// \param tolerance  as of frame_covariance, and so are cost and source
/// \throws std::invalid_argument  a tolerance that is not in [0, 1)
template <class Policy, class Frame, class... Groups>
int undetermined_directions(context<Policy>& ctx, basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>& problem,
                            double tolerance = 1e-17) {
  return detail::information_of(ctx, problem, tolerance).matrix.left_out();
}

/// Joint covariance of some frames of a problem at its current estimate, all other frames and the landmarks marginalised:
/// the inverse of J^T W J without damping, W with the weights of the robust kernels. Unknowns are those of Frame::retract
/// (pose_frame: rotation, rad, then translation, m, on the left of T_cw: in the axes of the camera). It is true to scale
/// where the information of the observations is.
///
/// The answer is per frame: rows and columns of a frame that the observations do not determine (a gauge or scale that is
/// free, a frame that sees too little, or one with a residual that is not finite) are NaN, and the others are right.
/// \param frames     places of frames in the input, in any order; a fixed one, or an unknown that is held, is known: its
///                   rows are 0
/// \param result     row-major, square, Frame::dof rows for each of `frames`, symmetric up to rounding
/// \param tolerance  what a motion of the frames that nothing holds may cost by rounding, relative to what the residuals
///                   sum up on the way: no less than the rounding of `long double` (on x86 1e-19) is taken. The default is for
///                   landmarks of up to some hundred rows each. With more, rounding may add up to something that looks like a
///                   direction that is told, with a sigma of kilometres: give 1e-15 then
/// \return whether all of `frames` are determined
/// \throws std::invalid_argument  a frame that is not there, or a tolerance that is not in [0, 1)
/// On the host, whatever the policy: O(observations (dof views)^2 + unknowns band^2), where band is how many unknowns lie
/// between frames that share a landmark. [Triggs et al. 2000, 9.5]
template <class Policy, class Frame, class... Groups, class List>
bool frame_covariance(context<Policy>& ctx, basic_bundle_problem<memory_of_t<Policy>, Frame, Groups...>& problem,
                      span<const std::int32_t> frames, List& result, double tolerance = 1e-17) {
  for (std::size_t i = 0; i < frames.size(); ++i)
    require(frames[i] >= 0 && frames[i] < problem.frame_count(), "frames[i]", frames[i], "is not a frame");

  constexpr int D = Frame::dof;
  const detail::frame_information information = detail::information_of(ctx, problem, tolerance);
  const auto& data = problem.data();
  const adjustment_structure& s = data.structure;

  const std::size_t n = frames.size() * D;
  const auto free_of = [&](std::size_t i) { return s.free_of_frame[static_cast<std::size_t>(frames[i])]; };
  const auto unknown_of = [&](std::size_t i) { return static_cast<std::size_t>(free_of(i / D)) * D + i % D; };
  const auto held = [&](std::size_t i) {
    const auto& masks = data.held.host();
    return !masks.empty() && (masks[static_cast<std::size_t>(free_of(i / D))] >> (i % D) & 1U) != 0;
  };
  const auto unknown_frame = [&](std::size_t i) {
    if (free_of(i) < 0) return false;
    for (std::size_t k = 0; k < D; ++k)
      if (information.undetermined[unknown_of(i * D + k)] != 0) return true;
    return false;
  };
  result.resize(n * n);
  bool all = true;
  plain_vector<long double> x;
  for (std::size_t c = 0; c < n; ++c) {
    const bool known = free_of(c / D) < 0 || held(c), lost = unknown_frame(c / D);
    all = all && !lost;
    x.assign(static_cast<std::size_t>(s.free_frames) * D, 0);
    if (!known && !lost) x[unknown_of(c)] = 1, information.matrix.solve(x);
    for (std::size_t r = 0; r < n; ++r) {
      const bool row_known = free_of(r / D) < 0 || held(r);
      result[r * n + c] = lost || unknown_frame(r / D) ? std::numeric_limits<double>::quiet_NaN()
                          : known || row_known         ? 0
                                                       : static_cast<double>(x[unknown_of(r)]);
    }
  }
  return all;
}

TURBOMAP_END_NAMESPACE
