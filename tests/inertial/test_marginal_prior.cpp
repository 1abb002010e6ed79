// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The marginal prior: derivatives against dual numbers; a window that slides against all frames at once; frames of which little
// is known.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include <turbomap/inertial/marginal_prior.hpp>

#include "inertial_scene.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::marginal_prior_factor;
using turbomap::state_marginaliser;
using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                             turbomap::precision_list<turbomap::precision::float64>>;

/// Six residuals of a pose that something else measured: rotation and position of the camera.
struct pose_factor {
  static constexpr int size = 6;
  struct row {
    turbomap::rigid_transform<double> measured;
    double rotation, position;  ///< 1 / sigma
  };
  template <class S, class = turbomap::detail::this_target>
  TURBOMAP_HD bool residual(const inertial_state<S>& x, const row& r, S* e) const {
    inertial_state<double> at;
    at.T_cw = r.measured;
    S d[15];
    marginal_prior_factor::difference(x, at, d);
    for (int k = 0; k < 6; ++k) e[k] = S(k < 3 ? r.rotation : r.position) * d[k];
    return true;
  }
};

/// What goes into the problems: states, edges, walks; a pose measurement per frame; something of the first frame.
struct chain {
  inertial_scene s;
  std::vector<pose_factor::row> poses;
  inertial_prior_factor::row first;
};

chain make_chain(unsigned seed, int frames) {
  chain c;
  c.s = make_inertial_scene(frames, 0, seed);
  std::mt19937_64 random(seed);
  for (const auto& x : c.s.truth) {
    double step[15] = {};
    std::normal_distribution<double> normal;
    for (int k = 0; k < 6; ++k) step[k] = (k < 3 ? 1e-3 : 1e-2) * normal(random);
    c.poses.push_back({turbomap::move_state(step, x).T_cw, 1e3, 1e2});
  }
  c.first = {c.s.truth[0].velocity + random_vector(random, 0.1), c.s.truth[0].bias, 10, 100, 10};
  turbomap::make_inertial_row(c.s.edges[0].motion, 1, c.s.edges[0]);  // in full
  return c;
}

using factors = turbomap::frame_pair_factors<inertial_factor>;
using walks = turbomap::frame_pair_factors<bias_walk_factor>;
using poses = turbomap::frame_factors<pose_factor>;
using known = turbomap::frame_factors<inertial_prior_factor>;
using marginal = turbomap::frame_factors<marginal_prior_factor>;

/// The best states of frames [from, to): with what is known of frame 0 where it is among them, else with a prior.
std::vector<inertial_state<double>> best(const chain& c, int from, int to,
                                         const std::vector<inertial_state<double>>& start,
                                         const marginal_prior_factor::row* prior) {
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, inertial_frame, factors, walks, poses, known, marginal> problem(ctx);
  std::vector<std::int32_t> first, second, all;
  for (int f = from; f < to; ++f) {
    all.push_back(f - from);
    if (f + 1 < to) first.push_back(f - from), second.push_back(f + 1 - from);
  }
  const auto at = static_cast<std::size_t>(from), edges = first.size();
  const std::int32_t oldest = 0;
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  const std::size_t priors = prior != nullptr ? 1 : 0, knowns = prior == nullptr ? 1 : 0;
  problem.assign(ctx, {start, {}, {}}, {}, factors{factor, first, second, {c.s.edges.data() + at, edges}, {}, 1e6},
                 walks{{}, first, second, {c.s.walks.data() + at, edges}, {}, 1e6},
                 poses{{}, all, {c.poses.data() + at, all.size()}, {}, 1e6},
                 known{{}, {&oldest, knowns}, {&c.first, knowns}, {}, 1e6},
                 marginal{{}, {&oldest, priors}, {prior, priors}, {}, 1e6});
  turbomap::adjustment_options options;
  options.numbers = turbomap::precision::float64, options.max_iterations = 50;
  turbomap::adjust<methods>(ctx, problem, options);
  std::vector<inertial_state<double>> states;
  problem.frames(ctx, states);
  return states;
}

/// In standard deviations of a prior: how far apart two states are.
double apart(const inertial_state<double>& a, const inertial_state<double>& b) {
  double d[15], worst = 0;
  marginal_prior_factor::difference(a, b, d);
  const double scale[5] = {1e3, 1e2, 1e2, 1e4, 1e2};
  for (int k = 0; k < 15; ++k) worst = std::max(worst, std::abs(d[k]) * scale[k / 3]);
  return worst;
}

marginal_prior_factor::row marginalised(const chain& c, int frame, const inertial_state<double>& leaves,
                                        const inertial_state<double>& stays, const marginal_prior_factor::row* prior) {
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  const auto k = static_cast<std::size_t>(frame);
  state_marginaliser out;
  if (prior != nullptr) REQUIRE(out.add(marginal_prior_factor{}, *prior, leaves));
  if (prior == nullptr) REQUIRE(out.add(inertial_prior_factor{}, c.first, leaves));
  REQUIRE(out.add(pose_factor{}, c.poses[k], leaves));
  REQUIRE(out.add(factor, c.s.edges[k], leaves, stays));
  REQUIRE(out.add(bias_walk_factor{}, c.s.walks[k], leaves, stays));
  return out.prior(stays);
}

TEST_CASE("derivatives are those of dual numbers") {
  using dual = turbomap::dual<15>;
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (const double off : {0.0, 1e-6, 0.1, 1.0}) {
    const chain c = make_chain(2, 2);
    marginal_prior_factor::row row{c.s.truth[0], {}, {}};
    for (double& x : row.R) x = normal(random);
    for (double& x : row.e) x = normal(random);
    double step[15], e[15], J[225];
    for (double& x : step) x = off * normal(random);
    const auto x = turbomap::move_state(step, c.s.truth[0]);
    marginal_prior_factor{}.linearise(x, row, e, J);
    dual d[15], expected[15];
    for (int k = 0; k < 15; ++k) d[k] = dual::variable(0, k);
    marginal_prior_factor{}.residual(turbomap::move_state(d, x), row, expected);
    for (int r = 0; r < 15; ++r) {
      CHECK(std::abs(e[r] - expected[r].a) < 1e-12);
      for (int k = 0; k < 15; ++k) CHECK(std::abs(J[15 * r + k] - expected[r].d[k]) < 1e-11);
    }
  }
}

TEST_CASE("linearised at the optimum of all frames, the prior keeps that optimum") {
  for (unsigned seed = 1; seed < 6; ++seed) {
    CAPTURE(seed);
    const chain c = make_chain(seed, 6);
    const auto all = best(c, 0, 6, c.s.states, nullptr);
    marginal_prior_factor::row prior;
    for (int f = 0; f + 1 < 6; ++f) {
      const auto i = static_cast<std::size_t>(f);
      prior = marginalised(c, f, all[i], all[i + 1], f == 0 ? nullptr : &prior);
      std::vector<inertial_state<double>> start(all.begin() + f + 1, all.end());
      double step[15];
      for (int k = 0; k < 15; ++k) step[k] = k < 9 ? 1e-3 : 1e-5;
      for (auto& x : start) x = turbomap::move_state(step, x);
      const auto rest = best(c, f + 1, 6, start, &prior);
      for (std::size_t k = 0; k < rest.size(); ++k) CHECK(apart(rest[k], all[i + 1 + k]) < 1e-4);
    }
  }
}

TEST_CASE("a window of three frames that slides is near to all frames at once, one that forgets is not") {
  double with = 0, without = 0;
  for (unsigned seed = 1; seed < 6; ++seed) {
    constexpr int frames = 12, window = 3;
    const chain c = make_chain(seed, frames);
    const auto all = best(c, 0, frames, c.s.states, nullptr);
    for (const bool keeps : {true, false}) {
      marginal_prior_factor::row prior, nothing{c.s.states[0], {}, {}};
      std::vector<inertial_state<double>> states(c.s.states.begin(), c.s.states.begin() + window);
      for (int f = 0;; ++f) {
        states = best(c, f, f + window, states, f == 0 ? nullptr : keeps ? &prior : &nothing);
        if (f + window == frames) break;
        prior = marginalised(c, f, states[0], states[1], f == 0 ? nullptr : &prior);
        states.erase(states.begin());
        states.push_back(c.s.states[static_cast<std::size_t>(f + window)]);
      }
      (keeps ? with : without) = std::max(keeps ? with : without, apart(states.back(), all.back()));
    }
  }
  MESSAGE("last frame, in standard deviations of the measurements: " << with << " with the prior, " << without
                                                                     << " without");
  CHECK(with < 0.05);
  CHECK(without > 10 * with);
}

TEST_CASE("a frame of which nothing is known says nothing of the next; what is not defined is not added") {
  const chain c = make_chain(3, 2);
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  state_marginaliser out;
  REQUIRE(out.add(factor, c.s.edges[0], c.s.states[0], c.s.states[1]));
  auto prior = out.prior(c.s.states[1]);
  double largest = 0, edge = 0;
  for (const double x : prior.R) largest = std::max(largest, std::abs(x));
  for (const double x : c.s.edges[0].whitening) edge = std::max(edge, std::abs(x));
  CHECK(largest < 1e-8 * edge);

  out.clear();
  prior = out.prior(c.s.states[1]);  // no factor at all
  CHECK(std::all_of(std::begin(prior.R), std::end(prior.R), [](double x) { return x == 0; }));
  auto bad = c.s.states[0];
  bad.velocity.x = std::nan("");
  CHECK_FALSE(out.add(factor, c.s.edges[0], bad, c.s.states[1]));
  CHECK_FALSE(out.add(factor, c.s.edges[0], c.s.states[0], c.s.states[1], -1.0));
  CHECK(out.prior(c.s.states[1]).R[0] == 0);
}

}  // namespace
