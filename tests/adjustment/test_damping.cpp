// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Damping by the diagonal against the oracle, in every kind of numbers and every solver.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <limits>
#include <stdexcept>
#include <type_traits>

#include "adjustment_cases.hpp"
#include "adjustment_scene_oracle.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap_test::sequential;

turbomap::adjustment_options diagonal() {
  turbomap::adjustment_options options = in_float64();
  options.damping = turbomap::damping_rule::diagonal, options.max_iterations = 6;
  return options;
}

TEST_CASE("an element is damped by itself, within bounds, or by lambda alone") {
  CHECK(turbomap::damping{0.5}(8) == 0.5);
  CHECK(turbomap::damping{0.5, true}(8) == 4);
  CHECK(turbomap::damping{0.5, true}(0) == 0.5e-6);
  CHECK(turbomap::damping{0.5, true}(1e40) == 0.5e32);
}

TEST_CASE("refused steps are damped 2, 4, 8 times as much, good ones down to a third") {
  turbomap::damping_control control;
  control.lambda = 1;
  for (const double expected : {2., 8., 64., 1024.}) {  // worse, no number, no decrease promised: all refused
    CHECK_FALSE(control.accepts(1, expected > 64 ? std::numeric_limits<double>::quiet_NaN() : 2, 0.5));
    CHECK(control.lambda == expected);
  }
  CHECK(control.accepts(2, 1, 1));  // as promised: 1 - (2 - 1)^3 = 0, no less than a third
  CHECK(control.lambda == doctest::Approx(1024 / 3.).epsilon(1e-15));
  CHECK(control.accepts(2, 1.25, 1.5));  // half of what was promised: 1, no more than two thirds
  CHECK(control.lambda == doctest::Approx(2048 / 9.).epsilon(1e-15));
  CHECK_FALSE(control.accepts(1, 2, 1));  // growth begins anew
  CHECK(control.lambda == doctest::Approx(4096 / 9.).epsilon(1e-15));
  control.refuse();
  CHECK(control.lambda == doctest::Approx(16384 / 9.).epsilon(1e-15));
}

TEST_CASE_TEMPLATE("steps damped by the diagonal are the oracle's", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const auto s = make_adjustment_scene(kind, 5, 2, 25, 7);
    oracle_problem o = oracle_of(s), by_identity = o;
    const auto costs = oracle_adjust(o, 6, true);
    REQUIRE(costs.size() == 6);
    REQUIRE(costs != oracle_adjust(by_identity, 6));
    auto options = diagonal();
    const auto a = adjust_scene(Policy{}, s, options);
    check_against_oracle(a, costs, o, 1e-8, 1e-6);
    CHECK(a.summary.each[0].lambda == 1e-4);
    // Weak directions are damped little: the rounding of float32 shows along the depth of points.
    options.numbers = precision::mixed;
    check_against_oracle(adjust_scene(Policy{}, s, options), costs, o, 1e-4, 1e-2);
    options.numbers = precision::float32;
    check_against_oracle(adjust_scene(Policy{}, s, options), costs, o, 1e-4, 1e-2);
  }
}

TEST_CASE("all solvers give one answer under either damping") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 9, 2, 80, 3);
  auto options = diagonal();
  options.initial_lambda = 0.1;  // enough to see a diagonal block left undamped
  options.pcg_tolerance = 1e-13;
  options.solver = reduced_solver::dense;
  const auto dense = adjust_scene(sequential{}, s, options);
  CHECK(dense.summary.each[0].lambda == 0.1);
  options.solver = reduced_solver::sparse;
  CHECK(distance(adjust_scene(sequential{}, s, options), dense) < 1e-9);
  options.solver = reduced_solver::pcg;
  CHECK(distance(adjust_scene(sequential{}, s, options), dense) < 1e-8);
}

TEST_CASE("without a fixed frame either damping holds the gauge") {
  const auto s = make_adjustment_scene(scene_kind::mono, 6, 0, 60, 5);
  oracle_problem o = oracle_of(s);
  const auto costs = oracle_adjust(o, 4, true);
  auto options = diagonal();
  options.max_iterations = 4;
  const auto a = adjust_scene(sequential{}, s, options);
  REQUIRE(a.summary.each.size() == costs.size());
  CHECK(a.summary.cost_final == doctest::Approx(costs.back()).epsilon(1e-5));
}

}  // namespace
