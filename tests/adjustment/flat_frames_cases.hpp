// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Frames of the user's own that have no pose: fewer unknowns than six, of which landmarks see one or more. Under any policy.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "adjustment_cases.hpp"

namespace turbomap_test {

/// A frame in the plane: a place and a heading. \tparam Seen  of which factors with landmarks depend on the first so many
template <int Seen>
struct flat_frame {
  static constexpr int dof = 3, landmark_dof = Seen;
  template <class S>
  struct state {
    S x[3];
  };
  template <class S>
  TURBOMAP_HD static state<S> retract(const state<double>& s, const S* step) {
    return {{S(s.x[0]) + step[0], S(s.x[1]) + step[1], S(s.x[2]) + step[2]}};
  }
  template <class S>
  TURBOMAP_HD static rigid_transform<S> pose(const state<S>& s) {
    rigid_transform<S> T{};
    T.qw = S(1), T.tx = s.x[0], T.ty = s.x[1];
    return T;
  }
};
/// The step from one frame to the other.
struct flat_odometry {
  static constexpr int size = 3;
  struct row {
    double x[3];
  };
  template <class F, class S>
  TURBOMAP_HD bool residual(const F& a, const F& b, const row& r, S* e) const {
    for (int i = 0; i < 3; ++i) e[i] = b.x[i] - a.x[i] - S(r.x[i]);
    return true;
  }
};
/// How far a landmark is ahead of the place of a frame; of the frame it depends on one number alone.
struct flat_sight {
  static constexpr int size = 3;
  struct row {
    double ahead;
  };
  template <class F, class S>
  TURBOMAP_HD bool residual(const F& a, const vec3<S>& X, const row& r, S* e) const {
    e[0] = X.x - a.x[0] - S(r.ahead), e[1] = X.y * X.x - S(0.5), e[2] = X.z - S(1);
    return true;
  }
};

/// A graph of frames, without landmarks.
template <class Policy>
void check_flat_graph(const Policy& policy) {
  using frame = flat_frame<3>;
  using state = frame::state<double>;
  constexpr int frames = 345;  // of so many, what is written beyond their room leaves the memory of the context
  std::vector<state> start;
  std::vector<std::uint8_t> fixed(frames);
  std::vector<std::int32_t> first, second;
  fixed[0] = 1;
  for (int f = 0; f < frames; ++f) start.push_back({{0.3 * f, 0.01 * f, 0}});
  for (int f = 0; f + 1 < frames; ++f) first.push_back(f), second.push_back(f + 1);
  const std::vector<flat_odometry::row> rows(first.size(), {{1, 0, 0.001}});
  for (const auto solver :
       {turbomap::reduced_solver::dense, turbomap::reduced_solver::sparse, turbomap::reduced_solver::pcg})
    for (const auto numbers : {turbomap::precision::float64, turbomap::precision::mixed}) {
      CAPTURE(static_cast<int>(solver));
      turbomap::context<Policy> ctx{policy};
      turbomap::bundle_problem<Policy, frame, turbomap::frame_pair_factors<flat_odometry>> problem(ctx);
      CHECK_FALSE(decltype(problem)::data_type::reprojections_only);  // whose couplings are made of poses
      problem.assign(ctx, {turbomap::span<const state>(start), turbomap::span<const std::uint8_t>(fixed)}, {},
                     {{},
                      turbomap::span<const std::int32_t>(first),
                      turbomap::span<const std::int32_t>(second),
                      turbomap::span<const flat_odometry::row>(rows),
                      {},
                      1e6});
      turbomap::adjustment_options options;
      options.numbers = numbers, options.solver = solver, options.max_iterations = 40, options.pcg_tolerance = 1e-6;
      const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
      CHECK(summary.cost_final < 1e-12);
      std::vector<state> found;
      problem.frames(ctx, found);
      CHECK(found.back().x[2] == doctest::Approx(0.344).epsilon(1e-6));
    }
}

/// Frames and landmarks of a short chain, and what was found of them, by a frame of which landmarks see so many unknowns.
template <int Seen, class Policy>
std::vector<double> adjust_flat_scene(const Policy& policy, turbomap::reduced_solver solver) {
  using frame = flat_frame<Seen>;
  using state = typename frame::template state<double>;
  constexpr int frames = 6, points = 21;
  const std::vector<state> start(frames);
  const std::vector<std::uint8_t> fixed{1, 0, 0, 0, 0, 0};
  const std::vector<vec3<double>> X(points, {1, 1, 0});
  std::vector<std::int32_t> first, second, seen_by, seen;
  std::vector<flat_sight::row> sights;
  for (int f = 0; f + 1 < frames; ++f) first.push_back(f), second.push_back(f + 1);
  for (int l = 0; l < points; ++l)
    for (int f = l % 3; f < frames; f += 1 + l % 2) {
      seen_by.push_back(f), seen.push_back(l);
      sights.push_back({2 + 0.25 * l - 0.3 * f + 0.01 * ((7 * l + 3 * f) % 5)});
    }
  const std::vector<flat_odometry::row> odometry(first.size(), {{0.3, 0.05, 0.1}});
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, frame, turbomap::frame_pair_factors<flat_odometry>,
                           turbomap::landmark_factors<flat_sight>>
      problem(ctx);
  problem.assign(ctx, {turbomap::span<const state>(start), turbomap::span<const std::uint8_t>(fixed)},
                 {turbomap::span<const vec3<double>>(X), {}},
                 {{},
                  turbomap::span<const std::int32_t>(first),
                  turbomap::span<const std::int32_t>(second),
                  turbomap::span<const flat_odometry::row>(odometry),
                  {},
                  1e6},
                 {{},
                  turbomap::span<const std::int32_t>(seen_by),
                  turbomap::span<const std::int32_t>(seen),
                  turbomap::span<const flat_sight::row>(sights),
                  {},
                  1e6});
  turbomap::adjustment_options options = in_float64();
  options.solver = solver, options.max_iterations = 60, options.pcg_tolerance = 1e-13;
  const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  std::vector<double> found{summary.cost_final};
  std::vector<state> states;
  std::vector<vec3<double>> landmarks;
  problem.frames(ctx, states), problem.landmarks(ctx, landmarks);
  for (const auto& s : states) found.insert(found.end(), s.x, s.x + 3);
  for (const auto& p : landmarks) found.insert(found.end(), {p.x, p.y, p.z});
  CHECK(summary.cost_final < 0.1 * summary.cost_initial);
  return found;
}

/// Landmarks that see one, two or three unknowns of a frame.
template <class Policy>
void check_flat_landmarks(const Policy& policy) {
  const auto three = adjust_flat_scene<3>(policy, turbomap::reduced_solver::dense);
  for (const auto solver :
       {turbomap::reduced_solver::dense, turbomap::reduced_solver::sparse, turbomap::reduced_solver::pcg})
    for (const auto& x : {adjust_flat_scene<1>(policy, solver), adjust_flat_scene<2>(policy, solver)}) {
      REQUIRE(x.size() == three.size());
      for (std::size_t i = 0; i < x.size(); ++i) CHECK(std::abs(x[i] - three[i]) < 1e-6);
    }
}

}  // namespace turbomap_test
