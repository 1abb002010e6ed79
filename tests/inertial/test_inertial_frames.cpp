// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// States of inertial frames that cannot be: refused by name, with the problem as it was; or said when it is adjusted.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <vector>

#include "adjustment/adjustment_results.hpp"
#include "inertial_scene.hpp"
#include "inertial_state_distance.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

turbomap::rigid_transform<double> scaled_rotation(turbomap::rigid_transform<double> T, double factor) {
  for (double* q : {&T.qx, &T.qy, &T.qz, &T.qw}) *q *= factor;
  return T;
}

TEST_CASE_TEMPLATE("a quaternion that is not of unit length is refused by name, and the problem stays", Policy,
                   TURBOMAP_TEST_POLICIES) {
  const auto good = make_inertial_scene(4, 10, 3);
  turbomap::context<Policy> ctx{Policy{}};
  inertial_problem<Policy> problem(ctx);
  good.assign(ctx, problem, inertial_factor{});
  const auto refused = [&](std::size_t f, double factor) {
    auto s = good;
    s.states[f].T_cw = scaled_rotation(s.states[f].T_cw, factor);
    CHECK_THROWS_WITH_AS(s.assign(ctx, problem, inertial_factor{}),
                         doctest::Contains("frames.states: squared norm of a quaternion"), std::invalid_argument);
  };
  for (const std::size_t f : {0U, 2U}) {  // 0 is fixed
    REQUIRE((good.fixed[f] != 0) == (f == 0));
    for (const double factor : {2.0, 0.0, 1.01, 0.99, 1e200}) {
      CAPTURE(f);
      CAPTURE(factor);
      refused(f, factor);
    }
  }
  std::vector<inertial_state<double>> states;
  problem.frames(ctx, states);
  REQUIRE(states.size() == good.states.size());
  CHECK(std::memcmp(states.data(), good.states.data(), states.size() * sizeof states[0]) == 0);
  CHECK(turbomap::adjust(ctx, problem).accepted > 0);

  auto rounded = good;  // in float, many times composed
  rounded.states[2].T_cw = scaled_rotation(rounded.states[2].T_cw, 1 + 1e-5);
  rounded.assign(ctx, problem, inertial_factor{});
  CHECK(turbomap::adjust(ctx, problem).accepted > 0);
}

TEST_CASE("a pose that is not a number: said so, and nothing moves") {
  for (const int what : {0, 1}) {
    auto s = make_inertial_scene(4, 10, 3);
    (what == 0 ? s.states[1].T_cw.qx : s.states[1].T_cw.tz) = std::numeric_limits<double>::quiet_NaN();
    turbomap::context<sequential> ctx{sequential{}};
    inertial_problem<sequential> problem(ctx);
    s.assign(ctx, problem, inertial_factor{});
    CHECK(turbomap::adjust(ctx, problem).end == turbomap::adjustment_end::not_finite);
    std::vector<inertial_state<double>> states;
    problem.frames(ctx, states);
    CHECK(std::memcmp(&states[2], &s.states[2], sizeof states[2]) == 0);
  }
}

TEST_CASE("a comparison of states and points keeps what is not a number, wherever it is") {
  const auto good = make_inertial_scene(3, 4, 3);
  CHECK(distance(good.states, good.states) == 0);
  CHECK(distance(good.points, good.points) == 0);
  for (std::size_t f = 0; f < 3; ++f) {
    auto states = good.states;
    auto points = good.points;
    states[f].T_cw.qx = points[f].x = std::numeric_limits<double>::quiet_NaN();
    CHECK(std::isnan(distance(states, good.states)));
    CHECK(std::isnan(distance(good.states, states)));
    CHECK(std::isnan(distance(points, good.points)));
  }
}

}  // namespace
