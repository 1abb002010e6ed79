// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Covariance of frames against the inverse of the oracle's normal equations of all unknowns, and against the scatter of
// many adjustments.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "adjustment_factors.hpp"
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
  const auto s = make_adjustment_scene(scene_kind::stereo, 210, 2, 30, 4);  // 1248 unknowns
  const auto ours = covariance_of(sequential{}, s, {3, 150});
  CHECK(relative_difference(ours, oracle_covariance(s, {3, 150})) < 1e-5);
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

TEST_CASE("what the problem does not tell is not made up") {
  const auto good = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, 7);
  auto s = good;
  s.fixed.assign(s.fixed.size(), 0);
  CHECK(covariance_of(sequential{}, s, {1}).empty());  // the gauge is free
  s = make_adjustment_scene(scene_kind::mono, 5, 1, 25, 7);
  CHECK(covariance_of(sequential{}, s, {1}).empty());  // ... or the scale
  s = good;
  for (std::size_t i = s.frame.size(); i-- > 0;)
    if (s.frame[i] == 0) {
      s.frame.erase(s.frame.begin() + static_cast<std::ptrdiff_t>(i));
      s.landmark.erase(s.landmark.begin() + static_cast<std::ptrdiff_t>(i));
      s.pixel.erase(s.pixel.begin() + static_cast<std::ptrdiff_t>(i));
      s.information.erase(s.information.begin() + static_cast<std::ptrdiff_t>(i));
      s.camera.erase(s.camera.begin() + static_cast<std::ptrdiff_t>(i));
    }
  CHECK(covariance_of(sequential{}, s, {0}).empty());           // a frame that sees nothing ...
  CHECK_FALSE(covariance_of(sequential{}, s, {1, 2}).empty());  // ... takes nothing from the others
  s = good;
  s.points[3].x = std::numeric_limits<double>::quiet_NaN();
  CHECK(covariance_of(sequential{}, s, {1}).empty());
  s = good;
  s.frame.clear(), s.landmark.clear(), s.pixel.clear(), s.information.clear(), s.camera.clear();
  CHECK(covariance_of(sequential{}, s, {1}).empty());
}

/// A scene of `group` alone, and one prior of a frame.
template <class List>
bool covariance_with_prior(const adjustment_scene& s, std::int32_t of, double weight, const rigid_transform<double>& T,
                           const std::vector<std::int32_t>& frames, List& result) {
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>,
                           turbomap::frame_factors<prior_factor>>
      problem(ctx);
  const prior_factor::row row{T};
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group(), {{weight}, {&of, 1}, {&row, 1}, {}, 1e6});
  return turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), result);
}

TEST_CASE("a scale that is free is not told by far points, and is by a weak prior") {
  for (unsigned seed = 0; seed < 120; ++seed) {
    CAPTURE(seed);
    auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 40, seed);
    for (auto& p : s.points) p = {100 * p.x, 100 * p.y, 100 * p.z};
    CHECK(covariance_of(sequential{}, s, {1}).empty());
    CHECK(covariance_of(sequential{}, s, {0, 3}).empty());
  }
  const auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 40, 7);
  std::vector<double> covariance;
  REQUIRE(covariance_with_prior(s, 0, 1e-3, s.poses[0], {0}, covariance));  // sigma 1 km
  const double sigma = std::sqrt(covariance[3 * 6 + 3] + covariance[4 * 6 + 4] + covariance[5 * 6 + 5]);
  CHECK(sigma > 900);
  CHECK(sigma < 1100);
}

TEST_CASE("the answer is per frame") {
  for (unsigned seed = 0; seed < 40; ++seed) {  // two points: a frame may turn about the line through them
    auto s = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, seed);
    auto two = s;
    two.frame.clear(), two.landmark.clear(), two.pixel.clear(), two.information.clear(), two.camera.clear();
    int kept = 0;
    for (std::size_t i = 0; i < s.frame.size(); ++i) {
      if (s.frame[i] == 0 && (s.pixel[i].z < 0 || ++kept > 2)) continue;
      two.frame.push_back(s.frame[i]), two.landmark.push_back(s.landmark[i]), two.pixel.push_back(s.pixel[i]);
      two.information.push_back(s.information[i]), two.camera.push_back(0);
    }
    REQUIRE(kept >= 2);
    CHECK(covariance_of(sequential{}, two, {0}).empty());
    CHECK_FALSE(covariance_of(sequential{}, two, {1, 2}).empty());
  }
  const auto s = make_adjustment_scene(scene_kind::stereo, 5, 2, 25, 7);
  std::vector<double> some;
  auto nowhere = s.poses[1];
  nowhere.tx = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(covariance_with_prior(s, 1, 1, nowhere, {0, 1, 4}, some));
  REQUIRE(some.size() == 18 * 18);
  const auto without = covariance_of(sequential{}, s, {0});
  for (std::size_t r = 0; r < 18; ++r)
    for (std::size_t c = 0; c < 18; ++c) {
      const bool of_1 = r / 6 == 1 || c / 6 == 1, of_4 = r / 6 == 2 || c / 6 == 2;
      CHECK(std::isnan(some[r * 18 + c]) == of_1);
      if (of_4 && !of_1) CHECK(some[r * 18 + c] == 0);  // fixed
      if (r < 6 && c < 6) CHECK(some[r * 18 + c] == doctest::Approx(without[r * 6 + c]).epsilon(1e-9));
    }
}

TEST_CASE("unknowns that are held are known") {
  const auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 25, 3);
  std::vector<std::uint32_t> held(4, 0);
  held[1] = 1U << 3;
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::bundle_problem<sequential, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  const auto in = s.frame_input();
  problem.assign(ctx, {in.states, in.fixed, {held.data(), 4}}, s.landmark_input(), s.group());
  const std::int32_t frame = 1;
  std::vector<double> with;
  REQUIRE(turbomap::frame_covariance(ctx, problem, {&frame, 1}, with));
  const auto all = covariance_of(sequential{}, s, {1});
  for (std::size_t r = 0; r < 6; ++r)
    for (std::size_t c = 0; c < 6; ++c) {  // conditioned on unknown 3
      const double expected = all[r * 6 + c] - all[r * 6 + 3] * all[3 * 6 + c] / all[3 * 6 + 3];
      CHECK(std::abs(with[r * 6 + c] - (r == 3 || c == 3 ? 0 : expected)) <= 1e-7 * std::sqrt(all[r * 7] * all[c * 7]));
    }
}

TEST_CASE("a landmark that is seen once takes nothing from what is known") {
  auto s = make_adjustment_scene(scene_kind::mono, 5, 2, 25, 7);
  const auto before = covariance_of(sequential{}, s, {0, 1});
  const vec3<double> p{0.1, 0.2, 4};
  s.points.push_back(p);
  s.frame.push_back(1), s.landmark.push_back(25), s.pixel.push_back({380, 260, -1});
  s.information.push_back(1), s.camera.push_back(0);
  CHECK(relative_difference(covariance_of(sequential{}, s, {0, 1}), before) < 1e-6);
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
    CHECK_THROWS_WITH_AS(turbomap::frame_covariance(ctx, problem, {}, result, t), doctest::Contains("tolerance"),
                         std::invalid_argument);
}

}  // namespace
