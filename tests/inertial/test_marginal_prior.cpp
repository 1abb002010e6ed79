// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The marginal prior: derivatives against dual numbers; a window that slides against all frames at once; frames of
// which little is known.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <random>

#include "marginal_prior_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE("derivatives are those of dual numbers") {
  using dual = turbomap::dual<15>;
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (const double off : {0.0, 1e-6, 0.1, 1.0}) {
    const inertial_chain c = make_chain(2, 2);
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

TEST_CASE("where it was linearised nothing is added, also to a quaternion that is not quite of unit length") {
  const inertial_chain c = make_chain(2, 2);
  const auto scaled = [&](double by) {
    auto x = c.s.truth[0];
    x.T_cw.qx *= by, x.T_cw.qy *= by, x.T_cw.qz *= by, x.T_cw.qw *= by;
    x.T_cw.tx += 50, x.T_cw.ty -= 1000;
    return x;
  };
  for (const double at : {1.0, 1 + 4e-4})
    for (const double by : {1.0, 1 - 4e-4, 1 + 4e-4}) {
      marginal_prior_factor::row row{scaled(at), {}, {}};
      for (int k = 0; k < 15; ++k) row.R[16 * k] = 1;
      double e[15], J[225];
      marginal_prior_factor{}.linearise(scaled(by), row, e, J);
      for (const double x : e) CHECK(std::abs(x) < 1e-11);
    }
}

TEST_CASE_TEMPLATE("linearised at the optimum of all frames, the prior keeps that optimum", Policy,
                   TURBOMAP_TEST_TWO_POLICIES) {
  check_chain_optimum(Policy{});
}

TEST_CASE("a window of three frames that slides is near to all frames at once, one that forgets is not") {
  check_sliding_window(sequential{});
}

TEST_CASE("a window of three frames that slides is the same under every policy") {
  for_each_parallel_policy([](auto policy) { check_windows_as_on_host(policy); });
}

TEST_CASE("a frame of which nothing is known says nothing of the next; what is not defined is not added") {
  const inertial_chain c = make_chain(3, 2);
  inertial_factor factor;
  factor.T_bc = c.s.T_bc, factor.gravity = c.s.gravity;
  state_marginaliser out;
  REQUIRE(out.add(factor, c.s.edges[0], c.s.states[0], c.s.states[1]));
  auto prior = out.prior(c.s.states[1]);
  double largest = 0, edge = 0;
  for (const double x : prior.R) largest = larger_or_nan(largest, std::abs(x));
  for (const double x : c.s.edges[0].whitening) edge = std::max(edge, std::abs(x));
  CHECK(largest < 1e-8 * edge);

  out.clear();
  prior = out.prior(c.s.states[1]);  // no factor at all
  CHECK(std::all_of(std::begin(prior.R), std::end(prior.R), [](double x) { return x == 0; }));
  auto bad = c.s.states[0];
  bad.velocity.x = std::nan("");
  CHECK_FALSE(out.add(factor, c.s.edges[0], bad, c.s.states[1]));
  for (const double weight : {-1.0, std::nan(""), std::numeric_limits<double>::infinity(), 1e308})
    CHECK_FALSE(out.add(factor, c.s.edges[0], c.s.states[0], c.s.states[1], weight));
  turbomap::pose_information seen;
  for (int i = 0, diagonal = 0; i < 6; ++i, diagonal += i + 1) seen.H[diagonal] = 1;
  CHECK(turbomap::make_pose_prior(c.s.states[1], seen, prior));
  seen.b[2] = std::nan("");
  CHECK_FALSE(turbomap::make_pose_prior(c.s.states[1], seen, prior));
  turbomap::inertial_factor::row row;
  CHECK(turbomap::make_inertial_row(c.s.edges[0].motion, 1, row));
  CHECK_FALSE(turbomap::make_inertial_row(c.s.edges[0].motion, std::numeric_limits<double>::infinity(), row));
  CHECK(out.prior(c.s.states[1]).R[0] == 0);
}

}  // namespace
