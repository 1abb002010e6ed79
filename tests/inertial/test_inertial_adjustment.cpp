// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Frames of 15 unknowns in every solver and kind of numbers: against an oracle without Schur complement, with formulas of its
// own and numerical derivatives; unknowns that are held; unknowns that nothing tells.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include <turbomap/adjustment/covariance.hpp>
#include <turbomap/inertial/inertial_edges.hpp>

#include "inertial_scene_oracle.hpp"
#include "inertial_solver_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/policies.hpp"
#include "undetermined_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::damping_rule;
using turbomap::every_adjustment_method;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap_test::sequential;
using float64_methods =
    turbomap::adjustment_methods<turbomap::adjustment_methods<>::solvers, turbomap::precision_list<precision::float64>>;

adjustment_options options_of(damping_rule damping, precision numbers = precision::float64) {
  adjustment_options options;
  options.numbers = numbers, options.damping = damping, options.max_iterations = 6, options.pcg_tolerance = 1e-13;
  return options;
}

void check(const adjusted_scene& a, const std::vector<double>& costs, const oracle_problem& o, double cost,
           double state) {
  REQUIRE(a.summary.each.size() == costs.size());
  for (std::size_t i = 0; i < costs.size(); ++i)
    CHECK(a.summary.each[i].cost == doctest::Approx(costs[i]).epsilon(cost));
  CHECK(distance(a.states, a.points, o) < state);
}

TEST_CASE_TEMPLATE("visual-inertial problems converge as the oracle does, in every solver", Policy,
                   TURBOMAP_TEST_POLICIES) {
  auto s = make_inertial_scene(6, 12, 5);
  SUBCASE("all unknowns") {}
  SUBCASE("a frame without an IMU, one whose pose is known, one of which a part is") {
    s.held.assign(6, 0);
    s.first = {0, 1, 3, 4}, s.second = {1, 2, 4, 5};
    s.edges.erase(s.edges.begin() + 2), s.walks.erase(s.walks.begin() + 2);
    s.held[2] = inertial_frame::hold_biases;
    s.held[4] = inertial_frame::hold_pose;
    s.held[5] = 1U << 4 | 1U << 7;
  }
  for (const auto damping : {damping_rule::identity, damping_rule::diagonal}) {
    oracle_problem o = oracle_of(s);
    const double before = o.cost();
    const auto costs = oracle_adjust(o, 6, damping == damping_rule::diagonal);
    REQUIRE(costs.back() < 0.1 * before);
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
      CAPTURE(static_cast<int>(solver));
      adjustment_options options = options_of(damping);
      options.solver = solver;
      const auto a = adjust_scene<float64_methods>(Policy{}, s, options);
      CHECK(a.summary.cost_initial == doctest::Approx(before).epsilon(1e-9));
      CHECK(a.summary.undetermined == 0);
      check(a, costs, o, 1e-6, 1e-4);
    }
  }
}

TEST_CASE("every solver in every precision under every policy: the oracle's optimum, and the same bits") {
  auto s = make_inertial_scene(5, 8, 5);
  SUBCASE("all unknowns") {}
  SUBCASE("some are held") {
    s.held.assign(5, 0);
    s.held[2] = inertial_frame::hold_biases, s.held[4] = 1U << 4 | 1U << 7;
  }
  oracle_problem o = oracle_of(s);
  const auto costs = oracle_adjust(o, 25, true);
  for (const auto numbers : {precision::float64, precision::mixed, precision::float32}) {
    // Of the optimum. mixed: gradients are rounded to float32, and the cost differs by the square of that. float32: residuals
    // are rounded too, to 5e-5 of a pixel.
    const double cost = numbers == precision::float64 ? 1e-9 : numbers == precision::mixed ? 1e-8 : 1e-4;
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
      CAPTURE(static_cast<int>(numbers));
      CAPTURE(static_cast<int>(solver));
      auto options = options_of(damping_rule::diagonal, numbers);
      options.max_iterations = 25, options.solver = solver, options.pcg_tolerance = 1e-8;
      const auto a = adjust_scene<every_adjustment_method>(sequential{}, s, options);
      REQUIRE(a.summary.each.size() > 4);
      for (std::size_t i = 0; i < 4; ++i) CHECK(a.summary.each[i].cost == doctest::Approx(costs[i]).epsilon(1e-4));
      CHECK(a.summary.cost_final == doctest::Approx(o.cost()).epsilon(cost));
      // In the others, unknowns that the cost hardly depends on (biases) are off by more than is worth asking for.
      if (numbers == precision::float64) CHECK(distance(a.states, a.points, o) < 1e-5);
      CHECK((a.summary.each[0].linear_iterations > 0) == (solver == reduced_solver::pcg));
      for_each_parallel_policy([&](auto policy) {
        const auto b = adjust_scene<every_adjustment_method>(policy, s, options);
        CHECK(same_bits(a.summary, b.summary));
        CHECK(same_bits(a.states, b.states));
        CHECK(same_bits(a.points, b.points));
      });
    }
  }
}

TEST_CASE_TEMPLATE(
    "every solver in every precision: as thrust::seq, also in another order of the rows; held unknowns stay", Policy,
    TURBOMAP_TEST_TWO_POLICIES) {
  for (const bool some_are_held : {false, true}) {
    CAPTURE(some_are_held);
    check_solvers(Policy{}, some_are_held);
  }
}

/// inertial_factor without its derivatives: dual numbers are taken.
struct by_duals : inertial_factor {
  void linearise() const = delete;
};

TEST_CASE("analytic derivatives of the factor are those of dual numbers") {
  const auto s = make_inertial_scene(4, 10, 3);
  const auto options = options_of(damping_rule::diagonal);
  const auto analytic = adjust_scene<float64_methods>(sequential{}, s, options);
  const auto dual = adjust_scene<float64_methods>(sequential{}, s, options, by_duals{});
  CHECK(analytic.summary.cost_final == doctest::Approx(dual.summary.cost_final).epsilon(1e-10));
  for (std::size_t f = 0; f < analytic.states.size(); ++f) {
    CHECK(std::abs(analytic.states[f].velocity.x - dual.states[f].velocity.x) < 1e-8);
    CHECK(std::abs(analytic.states[f].bias.acceleration.y - dual.states[f].bias.acceleration.y) < 1e-8);
  }
}

TEST_CASE("what is held stays to the last bit, what nothing tells is counted") {
  auto s = make_inertial_scene(5, 12, 4);
  SUBCASE("held") {
    s.held.assign(5, 0);
    s.held[3] = inertial_frame::hold_pose | inertial_frame::hold_velocity;
    s.held[2] = inertial_frame::hold_biases;
    const auto a = adjust_scene<float64_methods>(sequential{}, s, options_of(damping_rule::diagonal));
    CHECK(a.summary.accepted > 0);
    CHECK(std::memcmp(&a.states[3].T_cw, &s.states[3].T_cw, sizeof s.states[3].T_cw) == 0);
    CHECK(std::memcmp(&a.states[3].velocity, &s.states[3].velocity, sizeof s.states[3].velocity) == 0);
    CHECK(a.states[3].bias.gyro.x != s.states[3].bias.gyro.x);
    CHECK(std::memcmp(&a.states[2].bias, &s.states[2].bias, sizeof s.states[2].bias) == 0);
    CHECK(a.states[2].velocity.x != s.states[2].velocity.x);
  }
  SUBCASE("no IMU at all: nine unknowns of four frames") {
    s.first.clear(), s.second.clear(), s.edges.clear(), s.walks.clear(), s.prior_frame.clear(), s.priors.clear();
    auto a = adjust_scene<float64_methods>(sequential{}, s, options_of(damping_rule::diagonal));
    CHECK(a.summary.accepted > 0);
    CHECK(a.summary.undetermined == 36);
    CHECK(a.states[2].velocity.x == s.states[2].velocity.x);
    s.held.assign(5, inertial_frame::visual_only);
    a = adjust_scene<float64_methods>(sequential{}, s, options_of(damping_rule::diagonal));
    CHECK(a.summary.undetermined == 0);
    CHECK(a.states[2].velocity.x == s.states[2].velocity.x);
  }
  SUBCASE("masks of the wrong size") {
    s.held.assign(4, 0);
    CHECK_THROWS_WITH_AS(adjust_scene<float64_methods>(sequential{}, s, {}), doctest::Contains("frames.held.size()"),
                         std::invalid_argument);
  }
}

TEST_CASE_TEMPLATE("a velocity that nothing touches is counted, and stays", Policy, TURBOMAP_TEST_POLICIES) {
  check_untouched_velocity(Policy{});
}
TEST_CASE_TEMPLATE("a heading that is free has all frames in common: none of its unknowns is counted", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_free_heading(Policy{});
}
TEST_CASE_TEMPLATE("two frames that are joined to each other only: none of their unknowns is counted", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_untied_edge(Policy{});
}
TEST_CASE_TEMPLATE("a frame with one landmark: none of its unknowns is counted; with none, all are", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_one_landmark(Policy{});
}

TEST_CASE("a velocity that is not a number: said so, and nothing moves") {
  auto s = make_inertial_scene(4, 10, 3);
  s.states[1].velocity.y = std::numeric_limits<double>::quiet_NaN();
  const auto a = adjust_scene<float64_methods>(sequential{}, s, options_of(damping_rule::diagonal));
  CHECK(a.summary.end == adjustment_end::not_finite);
  CHECK(a.states[2].T_cw.tx == s.states[2].T_cw.tx);
}

TEST_CASE("covariance of 15 unknowns is the block of the inverse; a velocity that nothing tells is not known") {
  auto s = make_inertial_scene(5, 12, 6);
  turbomap::context<sequential> ctx{sequential{}};
  inertial_problem<sequential> problem(ctx);
  s.assign(ctx, problem, inertial_factor{});
  const std::int32_t frames[2] = {3, 1};
  std::vector<double> ours;
  REQUIRE(turbomap::frame_covariance(ctx, problem, {frames, 2}, ours));
  const oracle_problem o = oracle_of(s);
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  o.normal_equations(H, b);
  // Units differ by far: the inverse of the matrix with a diagonal of 1.
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd C =
      scale.asDiagonal() *
      (scale.asDiagonal() * H * scale.asDiagonal()).ldlt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols())) *
      scale.asDiagonal();
  double worst = 0;
  for (int r = 0; r < 30; ++r)
    for (int c = 0; c < 30; ++c) {
      const int R = 15 * (frames[r / 15] - 1) + r % 15, K = 15 * (frames[c / 15] - 1) + c % 15;  // frame 0 is fixed
      const double off = std::abs(ours[static_cast<std::size_t>(30 * r + c)] - C(R, K));
      worst = larger_or_nan(worst, off / std::sqrt(C(R, R) * C(K, K)));
    }
  CHECK(worst < 1e-4);

  s.first.resize(3), s.second.resize(3), s.edges.resize(3), s.walks.resize(3), s.prior_frame.clear(), s.priors.clear();
  s.assign(ctx, problem, inertial_factor{});  // frame 4 sees, and has no IMU
  const std::int32_t some[2] = {3, 4};
  CHECK_FALSE(turbomap::frame_covariance(ctx, problem, {some, 2}, ours));
  CHECK(ours[0] > 0);
  CHECK(std::isnan(ours[15 * 30 + 15]));
}

TEST_CASE("edges go to their groups; the large window has its own numbers") {
  const auto s = make_inertial_scene(4, 1, 3);
  turbomap::inertial_window_options options;
  turbomap::inertial_edges edges;
  for (int round = 0; round < 2; ++round) {
    options.all_robust = round == 1;
    edges.clear();
    for (std::size_t k = 0; k < s.edges.size(); ++k)
      CHECK(edges.add(s.first[k], s.second[k], s.edges[k].motion, k == 0, options));
    const auto robust = edges.robust({}, options);
    CHECK(edges.plain({}).rows.size() == (round == 0 ? 2 : 0));
    CHECK(robust.rows.size() == (round == 0 ? 1 : 3));
    CHECK(robust.kernel.delta2 == 16.92);
    CHECK(robust.rows[0].whitening[0] == doctest::Approx(s.edges[0].whitening[0]).epsilon(1e-12));  // weight 1e-2
    CHECK(edges.walks().rows.size() == 3);
    CHECK(edges.walks().second[2] == 3);
  }
  CHECK_FALSE(edges.add(0, 1, preintegration<double>{}, false, options));  // no time has passed
  CHECK(edges.walks().rows.size() == 3);
  preintegration<double> exact = s.edges[0].motion;
  exact.C_RR = {};
  CHECK_FALSE(edges.add(0, 1, exact, false, options, false));
  CHECK(edges.walks().rows.size() == 3);
  CHECK_FALSE(edges.add(0, 1, exact, false, options));
  CHECK(edges.walks().rows.size() == 4);  // they walk all the same
  CHECK(edges.robust({}, options).rows.size() == 3);
  options.oldest_edge_weight = 0;
  CHECK_THROWS_WITH_AS(edges.add(0, 1, s.edges[0].motion, true, options), doctest::Contains("oldest_edge_weight"),
                       std::invalid_argument);
  const auto large = turbomap::large_inertial_window();
  CHECK(large.keyframes == 25);
  CHECK(large.iterations == 4);
}

TEST_CASE("rows that cannot be made") {
  preintegration<double> none;
  inertial_factor::row row;
  CHECK_FALSE(turbomap::make_inertial_row(none, 1, row));
  bias_walk_factor::row walk;
  CHECK_FALSE(turbomap::make_walk_row(none, walk));
  const imu_motion m = make_imu_motion(3, 200, 1);
  const auto p = turbomap::preintegrate(m.samples(), m.intervals[0], m.biases[0], {});
  CHECK_FALSE(turbomap::make_inertial_row(p, 0, row));
  CHECK(turbomap::make_inertial_row(p, 1, row));
}

}  // namespace
