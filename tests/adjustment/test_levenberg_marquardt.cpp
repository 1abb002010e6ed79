// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Bundle adjustment against an oracle without Schur complement and analytic derivatives, under every host policy; all
// solvers and kinds of numbers; degenerate problems.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "adjustment_cases.hpp"
#include "adjustment_factors.hpp"
#include "adjustment_scene_oracle.hpp"
#include "reference/adjustment_oracle.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap::span;
using turbomap_test::sequential;
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

TEST_CASE_TEMPLATE("every kind of observation converges as the oracle does", Policy, TURBOMAP_TEST_POLICIES) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const auto s = make_adjustment_scene(kind, 5, 2, 25, 7);
    oracle_problem o = oracle_of(s);
    const double before = o.cost();
    adjustment_options options = in_float64();
    options.max_iterations = 6;
    const auto costs = oracle_adjust(o, 6);
    REQUIRE(costs.size() == 6);
    REQUIRE(costs.back() < 0.6 * before);
    const auto a = adjust_scene(Policy{}, s, options);
    CHECK(a.summary.cost_initial == doctest::Approx(before).epsilon(1e-10));
    check_against_oracle(a, costs, o, 1e-8, 1e-6);
    options.numbers = precision::mixed;
    check_against_oracle(adjust_scene(Policy{}, s, options), costs, o, 1e-5, 2e-3);
    options.numbers = precision::float32;
    check_against_oracle(adjust_scene(Policy{}, s, options), costs, o, 1e-4, 2e-3);
  }
}

TEST_CASE("the oracle gives the same with sparse equations") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, 7);
  for (const bool scaled : {false, true}) {
    oracle_problem dense = oracle_of(s), sparse = dense;
    const auto costs = oracle_adjust(dense, 6, scaled, 1e-3);
    const auto by_sparse = oracle_adjust<turbomap_test::sparse_equations>(sparse, 6, scaled, 1e-3);
    REQUIRE(costs.size() == 6);
    REQUIRE(by_sparse.size() == 6);
    for (std::size_t i = 0; i < 6; ++i) CHECK(by_sparse[i] == doctest::Approx(costs[i]).epsilon(1e-9));
  }
}

/// Newton's step overshoots: from x = 0.5 it only loses, unless it is damped.
struct steep_factor {
  static constexpr int size = 1;
  struct row {};
  template <class S>
  bool residual(const rigid_transform<S>& T, const row&, S* e) const {
    using std::atan;
    e[0] = atan(S(10) * T.tx);
    return true;
  }
};

TEST_CASE("steps that are refused: the damping grows by 2, 4, 8, ...") {
  const std::vector<rigid_transform<double>> start{{0, 0, 0, 1, 0.5, 0, 0}};
  const std::vector<std::int32_t> frame{0};
  const std::vector<steep_factor::row> rows(1);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::frame_factors<steep_factor>> problem(ctx);
  problem.assign(ctx, {span<const rigid_transform<double>>(start), {}}, {},
                 {{}, span<const std::int32_t>(frame), span<const steep_factor::row>(rows), {}, 1e6});
  adjustment_options options = in_float64();
  options.max_iterations = 1;
  const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  REQUIRE(summary.each.size() == 1);
  CHECK(summary.accepted == 1);
  const int steps = summary.each[0].steps;
  CHECK(steps > 3);
  const double slope = 10 / (1 + 25.0);
  CHECK(summary.each[0].lambda ==
        doctest::Approx(1e-5 * slope * slope * std::pow(2.0, steps * (steps - 1) / 2)).epsilon(1e-12));
  // The step before was worse, this one is better.
  const auto after = [&](double lambda) {
    const double e = std::atan(5.0), x = 0.5 - slope * e / (slope * slope + lambda);
    return std::atan(10 * x) * std::atan(10 * x);
  };
  CHECK(after(summary.each[0].lambda) == doctest::Approx(summary.cost_final).epsilon(1e-9));
  CHECK(after(summary.each[0].lambda / std::pow(2.0, steps - 1)) > summary.cost_initial);
  options.max_retries = 2;
  problem.assign(ctx, {span<const rigid_transform<double>>(start), {}}, {},
                 {{}, span<const std::int32_t>(frame), span<const steep_factor::row>(rows), {}, 1e6});
  const auto refused = turbomap::adjust<float64_methods>(ctx, problem, options);
  CHECK(refused.end == adjustment_end::no_descent);
  CHECK(refused.each[0].steps == 3);
  std::vector<rigid_transform<double>> same;
  problem.frames(ctx, same);
  CHECK(same[0].tx == 0.5);
}

TEST_CASE("all solvers give one answer") {
  for (const auto kind : {scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 9, 2, 80, 3);
    adjustment_options options = in_float64();
    options.pcg_tolerance = 1e-13;
    options.solver = reduced_solver::dense;
    const auto dense = adjust_scene(sequential{}, s, options);
    options.solver = reduced_solver::sparse;
    CHECK(distance(adjust_scene(sequential{}, s, options), dense) < 1e-9);
    options.solver = reduced_solver::pcg;
    const auto pcg = adjust_scene(sequential{}, s, options);
    CHECK(distance(pcg, dense) < 1e-8);
    CHECK(pcg.summary.each[0].linear_iterations > 0);
    options.solver = reduced_solver::automatic;
    CHECK(distance(adjust_scene(sequential{}, s, options), dense) == 0);
    options.dense_limit = 1, options.sparse_fill = 2;
    CHECK(distance(adjust_scene(sequential{}, s, options), dense) < 1e-9);
    options.sparse_limit = 1;
    CHECK(adjust_scene(sequential{}, s, options).summary.each[0].linear_iterations > 0);
  }
}

TEST_CASE("a problem is used again for larger and smaller ones") {
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  for (const int frames : {4, 9, 3})
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse}) {
      const auto s = make_adjustment_scene(scene_kind::stereo, frames, 1, 10 * frames, static_cast<unsigned>(frames));
      adjustment_options options = in_float64();
      options.solver = solver;
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      adjusted a;
      a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
      problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
      CHECK(distance(a, adjust_scene(sequential{}, s, options)) == 0);
    }
}

TEST_CASE("the same bits, whether or not the first step of the adjustment before was refused") {
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  adjustment_options options = in_float64();
  int refused = 0;
  constexpr unsigned scenes = 12;
  for (unsigned seed = 0; seed < scenes; ++seed) {
    CAPTURE(seed);
    auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 30, seed);
    for (auto& z : s.pixel) z.x += 30 * seed * normal(random), z.y += 30 * seed * normal(random);
    options.initial_lambda = seed % 2 == 0 ? 1e-9 : 1e7;  // a long step, and a short one
    const auto alone = adjust_scene(sequential{}, s, options);
    refused += alone.summary.each[0].steps > 1 ? 1 : 0;
    for (int again = 0; again < 2; ++again) {
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      adjusted a;
      a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
      problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
      CHECK(distance(a, alone) == 0);
      CHECK(a.summary.cost_final == alone.summary.cost_final);
    }
  }
  CHECK(refused > 0);
  CHECK(refused < static_cast<int>(scenes));
}

TEST_CASE("chi2 and depth of every observation, in the order of the input") {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 5, 2, 25, 7);
    const oracle_problem o = oracle_of(s);
    turbomap::context<sequential> ctx{sequential{}};
    turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
    std::vector<double> chi2, depth;
    problem.chi2<0>(ctx, chi2, depth);
    REQUIRE(chi2.size() == s.frame.size());
    for (std::size_t i = 0; i < chi2.size(); ++i) {
      CHECK(chi2[i] == doctest::Approx(o.residual(o.blocks[i]).squaredNorm()).epsilon(1e-9));
      const auto& f = o.frames[static_cast<std::size_t>(s.frame[i])];
      const oracle_frame mount = frame_of(s.rig[s.camera[i]].T_camera_body);
      const Eigen::Vector3d p = mount.R * (f.R * o.landmarks[static_cast<std::size_t>(s.landmark[i])] + f.t) + mount.t;
      CHECK(depth[i] == doctest::Approx(p.z()).epsilon(1e-12));
    }
  }
}

/// A problem of factors of one's own alone: odometry, a prior, bearings by dual numbers.
TEST_CASE_TEMPLATE("factors of one's own of every kind", Policy, TURBOMAP_TEST_POLICIES) {
  auto s = make_adjustment_scene(scene_kind::mono, 6, 0, 30, 5);
  std::vector<prior_factor::row> priors;
  std::vector<std::int32_t> prior_frames{0, 3, 0}, first{0, 2, 2, 5, 4}, second{1, 1, 3, 0, 3};
  std::vector<odometry_factor::row> odometry;
  for (const auto f : prior_frames) priors.push_back({s.true_poses[static_cast<std::size_t>(f)]});
  for (std::size_t i = 0; i < first.size(); ++i) odometry.push_back({{0.1 * static_cast<double>(i), 0.02, -0.01}});
  std::vector<bearing_factor::row> bearings;
  for (const auto& p : s.pixel) bearings.push_back({(p.x - 367) / 435, (p.y - 252) / 436});
  using turbomap::cauchy;
  const turbomap::landmark_factors<bearing_factor, cauchy> g{{200.0},
                                                             {s.frame.data(), s.frame.size()},
                                                             {s.landmark.data(), s.landmark.size()},
                                                             {bearings.data(), bearings.size()},
                                                             {4.0},
                                                             1e6};
  const turbomap::frame_factors<prior_factor> h{
      {10.0}, {prior_frames.data(), prior_frames.size()}, {priors.data(), priors.size()}, {}, 1e6};
  const turbomap::frame_pair_factors<odometry_factor, turbomap::tukey> k{
      {100.0}, {first.data(), first.size()}, {second.data(), second.size()}, {odometry.data(), odometry.size()}, {1e5},
      1e6};

  oracle_problem o;
  for (const auto& T : s.poses) o.frames.push_back(frame_of(T));
  o.frame_fixed.assign(6, false);
  for (const auto& p : s.points) o.landmarks.emplace_back(p.x, p.y, p.z);
  o.landmark_fixed.assign(s.points.size(), false);
  s.fixed.assign(6, 0);
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    oracle_block b;
    b.frame = s.frame[i], b.landmark = s.landmark[i];
    const auto z = bearings[i];
    b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d& X) {
      const Eigen::Vector3d p = f.R * X + f.t;
      return Eigen::VectorXd(200 * Eigen::Vector2d(p.x() / p.z() - z.x, p.y() / p.z() - z.y));
    };
    b.kernel = [](double chi2, double& rho, double& weight) {
      rho = 4 * std::log(1 + chi2 / 4), weight = 4 / (4 + chi2);
    };
    o.blocks.push_back(b);
  }
  for (std::size_t i = 0; i < priors.size(); ++i) {
    oracle_block b;
    b.frame = prior_frames[i];
    const oracle_frame z = frame_of(priors[i].T_cw);
    b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d&) {
      Eigen::VectorXd e(6);
      e << f.t - z.t, f.R(2, 1) - z.R(2, 1), f.R(0, 2) - z.R(0, 2), f.R(1, 0) - z.R(1, 0);
      return Eigen::VectorXd(10 * e);
    };
    b.kernel = [](double chi2, double& rho, double& weight) { rho = chi2, weight = 1; };
    o.blocks.push_back(b);
  }
  for (std::size_t i = 0; i < first.size(); ++i) {
    oracle_block b;
    b.frame = first[i], b.other = second[i];
    const auto z = odometry[i].shift;
    b.e = [=](const oracle_frame& f, const oracle_frame& t, const Eigen::Vector3d&) {
      return Eigen::VectorXd(100 * (f.R.transpose() * (t.t - 0.5 * f.t) - Eigen::Vector3d(z.x, z.y, z.z)));
    };
    b.kernel = [](double chi2, double& rho, double& weight) {
      const double x = chi2 < 1e5 ? 1 - chi2 / 1e5 : 0;
      rho = 1e5 / 3 * (1 - x * x * x), weight = x * x;
    };
    o.blocks.push_back(b);
  }
  const auto costs = oracle_adjust(o, 6);
  for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
    CAPTURE(static_cast<int>(solver));
    adjustment_options options = in_float64();
    options.max_iterations = 6, options.solver = solver, options.pcg_tolerance = 1e-13;
    turbomap::context<Policy> ctx{Policy{}};
    turbomap::bundle_problem<Policy, pose_frame, turbomap::frame_pair_factors<odometry_factor, turbomap::tukey>,
                             turbomap::landmark_factors<bearing_factor, cauchy>, turbomap::frame_factors<prior_factor>>
        problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), k, g, h);
    adjusted a;
    a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    check_against_oracle(a, costs, o, 1e-7, 1e-5);
  }
}

/// What must not change when nothing is to be done.
void check_unchanged(const adjusted& a, const adjustment_scene& s, adjustment_end end) {
  CHECK(std::string(turbomap::to_string(a.summary.end)) == std::string(turbomap::to_string(end)));
  CHECK(a.summary.accepted == 0);
  CHECK(distance(a, adjusted{{}, s.poses, s.points}) == 0);
}

TEST_CASE_TEMPLATE("degenerate problems end with a reason and unchanged", Policy, TURBOMAP_TEST_POLICIES) {
  const auto good = make_adjustment_scene(scene_kind::stereo, 4, 1, 12, 2);
  SUBCASE("nothing at all") {
    const adjustment_scene s = make_adjustment_scene(scene_kind::stereo, 0, 0, 0, 2);
    check_unchanged(adjust_scene(Policy{}, s, {}), s, adjustment_end::no_observations);
  }
  SUBCASE("no observations") {
    adjustment_scene s = good;
    s.frame.clear(), s.landmark.clear(), s.pixel.clear(), s.information.clear(), s.camera.clear();
    check_unchanged(adjust_scene(Policy{}, s, {}), s, adjustment_end::no_observations);
  }
  SUBCASE("not a number, in each input") {
    for (int where = 0; where < 4; ++where) {
      adjustment_scene s = good;
      if (where == 0) s.points[3].y = nan_value;
      if (where == 1) s.pixel[5].x = std::numeric_limits<double>::infinity();
      if (where == 2) s.information[5] = nan_value;
      if (where == 3) s.poses[1].tx = nan_value;
      turbomap::context<Policy> ctx{Policy{}};
      turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      const auto summary = turbomap::adjust<float64_methods>(ctx, problem, in_float64());
      CHECK(summary.end == adjustment_end::not_finite);
      CHECK(summary.accepted == 0);
      adjusted a;  // NaN is not equal to itself: compared as bytes
      problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
      CHECK(std::memcmp(a.poses.data(), s.poses.data(), s.poses.size() * sizeof s.poses[0]) == 0);
      CHECK(std::memcmp(a.points.data(), s.points.data(), s.points.size() * sizeof s.points[0]) == 0);
    }
  }
  SUBCASE("everything fixed") {
    adjustment_scene s = good;
    s.fixed.assign(s.poses.size(), 1);
    turbomap::context<Policy> ctx{Policy{}};
    turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    const std::vector<std::uint8_t> landmarks_fixed(s.points.size(), 1);
    problem.assign(ctx, s.frame_input(),
                   {span<const vec3<double>>(s.points), span<const std::uint8_t>(landmarks_fixed)}, s.group());
    CHECK(turbomap::adjust<float64_methods>(ctx, problem, in_float64()).end == adjustment_end::nothing_free);
  }
  SUBCASE("all weights zero: rows switched off") {
    adjustment_scene s = good;
    s.information.assign(s.information.size(), 0);
    check_unchanged(adjust_scene(Policy{}, s, {}), s, adjustment_end::converged);
  }
  SUBCASE("all are outliers of a kernel that forgets them") {
    adjustment_scene s = good;
    for (auto& z : s.pixel) z.x += 1000, z.z = -1;
    const auto g = s.group();
    turbomap::reprojections<scene_camera, turbomap::tukey> all;
    all.rig = g.rig, all.frame = g.frame, all.landmark = g.landmark, all.pixel = g.pixel;
    all.information = g.information, all.camera = g.camera;
    turbomap::context<Policy> ctx{Policy{}};
    turbomap::bundle_problem<Policy, pose_frame, decltype(all)> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), all);
    adjusted a;
    a.summary = turbomap::adjust<float64_methods>(ctx, problem, in_float64());
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    check_unchanged(a, s, adjustment_end::converged);
    CHECK(a.summary.cost_final == doctest::Approx(21.95 / 3 * static_cast<double>(s.pixel.size())));
  }
  SUBCASE("no iterations") {
    adjustment_options options = in_float64();
    options.max_iterations = 0;
    check_unchanged(adjust_scene(Policy{}, good, options), good, adjustment_end::max_iterations);
  }
  SUBCASE("the flag was set before") {
    const std::atomic<bool> stop{true};
    adjustment_options options = in_float64();
    options.stop = &stop;
    check_unchanged(adjust_scene(Policy{}, good, options), good, adjustment_end::stopped);
  }
}

TEST_CASE_TEMPLATE("hard problems end, and never worse", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 30, 2);
  adjustment_options options = in_float64();
  options.max_iterations = 30;
  const auto check = [&](const adjustment_scene& scene) {
    for (const auto numbers : {precision::float64, precision::mixed, precision::float32})
      for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
        options.numbers = numbers, options.solver = solver;
        const auto a = adjust_scene(Policy{}, scene, options);
        CHECK(a.summary.cost_final <= a.summary.cost_initial);
        for (const auto& p : a.points) CHECK(turbomap::detail::is_finite(p.x + p.y + p.z));
      }
  };
  SUBCASE("no fixed frame") {
    s.fixed.assign(s.poses.size(), 0);
    check(s);
    options.numbers = precision::float64, options.solver = reduced_solver::dense;
    const auto a = adjust_scene(Policy{}, s, options);
    CHECK(a.summary.cost_final < 0.5 * a.summary.cost_initial);
  }
  SUBCASE("points seen once, or by nobody; a frame that sees nothing") {
    s.points.push_back({0, 0, 4}), s.points.push_back({1, 0, 4});
    s.frame.push_back(0), s.landmark.push_back(30), s.pixel.push_back({360, 250, -1}), s.information.push_back(1);
    s.camera.push_back(0);
    s.poses.push_back({}), s.fixed.push_back(0);
    check(s);
    const auto a = adjust_scene(Policy{}, s, options);
    CHECK(a.points[31].x == 1);
    CHECK(a.poses[5].tx == 0);
  }
  SUBCASE("behind the camera, in its focal plane, at its centre") {
    s.points[0].z = -5, s.points[1].z = 0, s.points[2] = {0, 0, 0};
    s.poses[4] = {};
    check(s);
  }
  SUBCASE("every point behind every camera, and far off in the image") {
    for (auto& p : s.points) p.z -= 20;
    check(s);
  }
  SUBCASE("every pixel is an outlier") {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (auto& z : s.pixel) z.x += 300 * normal(random), z.y += 300 * normal(random);
    check(s);
  }
  SUBCASE("every point seen once") {
    std::vector<bool> seen(s.points.size(), false);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      const auto l = static_cast<std::size_t>(s.landmark[i]);
      if (seen[l]) continue;
      seen[l] = true;
      s.frame[kept] = s.frame[i], s.landmark[kept] = s.landmark[i], s.pixel[kept] = s.pixel[i];
      s.information[kept] = s.information[i], s.camera[kept] = s.camera[i], ++kept;
    }
    s.frame.resize(kept), s.landmark.resize(kept), s.pixel.resize(kept), s.information.resize(kept);
    s.camera.resize(kept);
    check(s);
  }
  SUBCASE("one observation") {
    s.frame.resize(1), s.landmark.resize(1), s.pixel.resize(1), s.information.resize(1), s.camera.resize(1);
    check(s);
  }
  SUBCASE("points at infinity") {
    for (int l = 0; l < 5; ++l) s.points[static_cast<std::size_t>(l)] = {1e9, 1e9, 1e10};
    check(s);
  }
}

TEST_CASE("landmarks may be fixed: poses alone move") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 4, 0, 30, 9);
  oracle_problem o = oracle_of(s);
  o.landmark_fixed.assign(s.points.size(), true);
  for (std::size_t l = 0; l < 5; ++l) o.landmark_fixed[l] = false;
  std::vector<std::uint8_t> fixed(s.points.size(), 1);
  std::fill_n(fixed.begin(), 5, std::uint8_t{0});
  const auto costs = oracle_adjust(o, 5);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), {span<const vec3<double>>(s.points), span<const std::uint8_t>(fixed)},
                 s.group());
  adjustment_options options = in_float64();
  options.max_iterations = 5;
  adjusted a;
  a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
  check_against_oracle(a, costs, o, 1e-8, 1e-6);
}

TEST_CASE("slow progress and the time budget end it") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 1, 30, 2);
  adjustment_options options = in_float64();
  options.max_iterations = 200;
  const auto full = adjust_scene(sequential{}, s, options);
  CHECK((full.summary.end == adjustment_end::converged || full.summary.end == adjustment_end::no_descent));
  CHECK(full.summary.iterations < 200);
  options.min_relative_decrease = 1e-3;
  const auto slow = adjust_scene(sequential{}, s, options);
  CHECK(slow.summary.end == adjustment_end::converged);
  CHECK(slow.summary.iterations < full.summary.iterations);
  REQUIRE(slow.summary.each.size() >= 4);
  for (std::size_t i = slow.summary.each.size() - 3; i < slow.summary.each.size(); ++i)
    CHECK(slow.summary.each[i - 1].cost - slow.summary.each[i].cost < 1e-3 * slow.summary.each[i - 1].cost);
  options.time_budget_ms = 1e-6;
  const auto timed = adjust_scene(sequential{}, s, options);
  CHECK(timed.summary.end == adjustment_end::time_budget);
  CHECK(timed.summary.iterations == 1);
}

TEST_CASE("bad input is refused by name, and the problem stays") {
  const auto good = make_adjustment_scene(scene_kind::stereo, 4, 1, 12, 2);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, good.frame_input(), good.landmark_input(), good.group());
  const auto refused = [&](adjustment_scene s, const char* name) {
    try {
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      FAIL("not refused: " << name);
    } catch (const std::invalid_argument& e) {
      CHECK(std::string(e.what()).find(name) != std::string::npos);
    }
  };
  adjustment_scene s = good;
  s.frame[2] = 4, refused(s, "frame = 4");
  s = good, s.frame[2] = -1, refused(s, "frame = -1");
  s = good, s.landmark[2] = 12, refused(s, "landmark = 12");
  s = good, s.camera[2] = 1, refused(s, "camera = 1");
  s = good, s.information[1] = -2, refused(s, "information = -2");
  s = good, s.fixed.pop_back(), refused(s, "frames.fixed.size()");
  s = good, s.pixel.pop_back(), refused(s, "pixel.size()");
  s = good, s.rig.clear(), s.rig.shrink_to_fit(), refused(s, "rig.count");
  CHECK(problem.observation_count() == static_cast<int>(good.frame.size()));
  adjustment_options options = in_float64();
  options.max_iterations = -1;
  CHECK_THROWS_AS(turbomap::adjust<float64_methods>(ctx, problem, options), std::invalid_argument);
  options = {}, options.initial_lambda = nan_value;
  CHECK_THROWS_AS(turbomap::adjust<float64_methods>(ctx, problem, options), std::invalid_argument);
  for (const double tolerance :
       {0., 1., 1e200, nan_value}) {  // 1: no product with S is ever needed, and no step is one
    options = in_float64(), options.pcg_tolerance = tolerance;
    CHECK_THROWS_WITH_AS(turbomap::adjust<float64_methods>(ctx, problem, options),
                         doctest::Contains("options.pcg_tolerance"), std::invalid_argument);
  }
  adjusted a;
  a.summary = turbomap::adjust<float64_methods>(ctx, problem, in_float64());
  problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
  CHECK(distance(a, adjust_scene(sequential{}, good, in_float64())) == 0);
}

TEST_CASE("what a program does not compile is refused by name, and automatic does without it") {
  using turbomap::adjustment_methods;
  using turbomap::precision_list;
  using turbomap::solver_list;
  const auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 12, 2);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  using sparse_alone = adjustment_methods<solver_list<reduced_solver::sparse>, precision_list<precision::float64>>;
  using pcg_alone = adjustment_methods<solver_list<reduced_solver::pcg>, precision_list<precision::float64>>;
  adjustment_options options = in_float64();
  CHECK_THROWS_WITH_AS(turbomap::adjust(ctx, problem, options), doctest::Contains("options.numbers = float64"),
                       std::invalid_argument);
  options.solver = reduced_solver::dense;
  CHECK_THROWS_WITH_AS(turbomap::adjust<sparse_alone>(ctx, problem, options),
                       doctest::Contains("options.solver = dense"), std::invalid_argument);
  options.solver = reduced_solver::automatic;  // dense, if it were there
  const auto sparse = turbomap::adjust<sparse_alone>(ctx, problem, options);
  CHECK(sparse.accepted > 0);
  CHECK(sparse.each[0].linear_iterations == 0);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  CHECK(turbomap::adjust<pcg_alone>(ctx, problem, options).each[0].linear_iterations > 0);
}

}  // namespace
