// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Covariance of frames against the inverse of the oracle's normal equations of all unknowns, and against the scatter of
// many adjustments.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "adjustment_scene_oracle.hpp"
#include "covariance_cases.hpp"
#include "reference/eigen.hpp"
#include "support/policies.hpp"
TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/LU>
TURBOMAP_TEST_EIGEN_END

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

std::vector<double> oracle_covariance(const adjustment_scene& s, const std::vector<std::int32_t>& frames) {
  const oracle_problem o = oracle_of(s);
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  o.normal_equations(H, b);
  const Eigen::MatrixXd all = H.fullPivLu().inverse();
  std::vector<int> of_frame, of_landmark;
  o.number(of_frame, of_landmark);
  std::vector<double> result;
  for (const auto f : frames)
    for (int i = 0; i < 6; ++i)
      for (const auto g : frames)
        for (int j = 0; j < 6; ++j) {
          const int r = of_frame[static_cast<std::size_t>(f)], c = of_frame[static_cast<std::size_t>(g)];
          result.push_back(r < 0 || c < 0 ? 0 : all(r + i, c + j));
        }
  return result;
}

TEST_CASE_TEMPLATE("the covariance is the block of the inverse of all normal equations", Policy,
                   TURBOMAP_TEST_POLICIES) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const auto s = make_adjustment_scene(kind, 5, 2, 25, 7);
    for (const std::vector<std::int32_t>& frames : {std::vector<std::int32_t>{1}, {2, 0}, {0, 4, 1, 2}}) {
      const auto ours = covariance_of(Policy{}, s, frames);
      REQUIRE(ours.size() == 36 * frames.size() * frames.size());
      CHECK(relative_difference(ours, oracle_covariance(s, frames)) < 1e-6);
      CHECK(ours == covariance_of(sequential{}, s, frames));
    }
  }
}

TEST_CASE("many frames") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 80, 2, 30, 4);  // 468 unknowns
  const auto ours = covariance_of(sequential{}, s, {3, 60});
  CHECK(relative_difference(ours, oracle_covariance(s, {3, 60})) < 1e-5);
}

TEST_CASE("what was seen says how far off the estimate is") {  // scatter of optima over noise, against the covariance
  auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 40, 21);
  const auto& c = s.rig[0];
  s.poses = s.true_poses, s.points = s.true_points;
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 1);
  const auto truth = s;
  using policy = sequential;
  turbomap::context<policy> ctx{policy{}};
  turbomap::bundle_problem<policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  double scatter = 0;
  const int rounds = 400;
  std::vector<double> covariance;
  for (int round = 0; round <= rounds; ++round) {
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      using turbomap::operator*;
      const auto p = turbomap::to_isometry<double>(truth.poses[static_cast<std::size_t>(s.frame[i])]) *
                     truth.points[static_cast<std::size_t>(s.landmark[i])];
      vec2<double> q{};
      REQUIRE(c.camera.project(p, q));
      const double sigma = round == 0 ? 0 : 0.1 / std::sqrt(s.information[i]);
      const bool stereo = truth.pixel[i].z >= 0;
      s.pixel[i] = {q.x + sigma * normal(random), q.y + sigma * normal(random),
                    stereo ? q.x - c.bf / p.z + sigma * normal(random) : -1};
    }
    problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
    if (round == 0) {
      const std::int32_t frame = 1;
      REQUIRE(turbomap::frame_covariance(ctx, problem, {&frame, 1}, covariance));
      continue;
    }
    turbomap::adjust<float64_methods>(ctx, problem, in_float64());
    std::vector<rigid_transform<double>> poses;
    problem.frames(ctx, poses);
    scatter += std::pow(poses[1].tx - truth.poses[1].tx, 2);
  }
  // sigma was a tenth of what the information says; the sample variance of 400 is known to 7 %. (tx moves by the
  // translation of the step and by the rotation about a far origin, which is small here.)
  CHECK(100 * scatter / rounds == doctest::Approx(covariance[3 * 6 + 3]).epsilon(0.3));
}

TEST_CASE_TEMPLATE("what the problem does not tell is not made up", Policy, TURBOMAP_TEST_POLICIES) {
  check_not_made_up(Policy{});
}
TEST_CASE_TEMPLATE("a scale that is free is not told by far points, and is by a weak prior", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_free_scale(Policy{});
}
TEST_CASE_TEMPLATE("the answer is per frame", Policy, TURBOMAP_TEST_POLICIES) { check_answer_per_frame(Policy{}); }
TEST_CASE_TEMPLATE("unknowns that are held are known", Policy, TURBOMAP_TEST_POLICIES) {
  check_held_unknowns(Policy{});
}
TEST_CASE_TEMPLATE("a landmark that is seen once takes nothing from what is known", Policy, TURBOMAP_TEST_POLICIES) {
  check_landmark_seen_once(Policy{});
}

TEST_CASE("a free scale where landmarks have very many rows: by a tolerance of 1e-15") {
  for (const unsigned seed : {1U, 2U})
    for (const bool one : {false, true}) {
      CAPTURE(seed);
      CAPTURE(one);
      auto s = make_adjustment_scene(scene_kind::mono, 5, 1, 30, seed);
      const std::size_t n = s.frame.size();
      for (int again = 0; again < (one ? 3000 : 100); ++again)
        for (std::size_t i = 0; i < n; ++i) {
          if (one && s.landmark[i] != 0) continue;
          s.frame.push_back(s.frame[i]), s.landmark.push_back(s.landmark[i]), s.pixel.push_back(s.pixel[i]);
          s.information.push_back(s.information[i]), s.camera.push_back(s.camera[i]);
        }
      turbomap::context<sequential> ctx{sequential{}};
      turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
      problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
      CHECK(turbomap::undetermined_directions(ctx, problem, 1e-15) == 1);
    }
}

TEST_CASE("an adjustment is not disturbed") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 6, 2, 60, 9);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  turbomap::adjustment_options one = in_float64();
  one.max_iterations = 3;
  turbomap::adjust<float64_methods>(ctx, problem, one);
  const std::int32_t frame = 2;
  std::vector<double> first, second;
  REQUIRE(turbomap::frame_covariance(ctx, problem, {&frame, 1}, first));
  adjusted with, without;
  turbomap::adjust<float64_methods>(ctx, problem, one);
  problem.frames(ctx, with.poses), problem.landmarks(ctx, with.points);
  REQUIRE(turbomap::frame_covariance(ctx, problem, {&frame, 1}, second));
  CHECK(first != second);  // at the estimate of its time
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  turbomap::adjust<float64_methods>(ctx, problem, one);
  turbomap::adjust<float64_methods>(ctx, problem, one);
  problem.frames(ctx, without.poses), problem.landmarks(ctx, without.points);
  CHECK(distance(with, without) == 0);
}

TEST_CASE("bad frames and tolerances are refused by name") {
  const auto s = make_adjustment_scene(scene_kind::mono, 4, 2, 10, 9);
  CHECK_THROWS_WITH_AS(covariance_of(sequential{}, s, {0, 4}), doctest::Contains("frames[i]"), std::invalid_argument);
  CHECK_THROWS_AS(covariance_of(sequential{}, s, {-1}), std::invalid_argument);
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  std::vector<double> result;
  for (const double t : {-1.0, 1.0, std::numeric_limits<double>::quiet_NaN()})
    for (const auto& refused :
         std::vector<std::function<void()>>{[&] { turbomap::frame_covariance(ctx, problem, {}, result, t); },
                                            [&] { turbomap::undetermined_directions(ctx, problem, t); }})
      CHECK_THROWS_WITH_AS(refused(), doctest::Contains("tolerance"), std::invalid_argument);
}

}  // namespace
