// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Every host policy gives the same bits, whatever the compiler may fuse: to be compiled for several processors
// (-march=x86-64, x86-64-v3, x86-64-v3 -mtune=znver3, native).

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cstdint>
#include <vector>

#include "adjustment_cases.hpp"
#include "adjustment_factors.hpp"
#include "adjustment_results.hpp"
#include "covariance_cases.hpp"
#include "motion_only_cases.hpp"
#include "support/policies.hpp"
#include "support/thread_counts.hpp"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_options;
using turbomap::damping_rule;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap::span;
using turbomap_test::sequential;

bool same(const adjusted& a, const adjusted& b) {
  return same_bits(a.summary, b.summary) && same_bits(a.poses, b.poses) && same_bits(a.points, b.points);
}

TEST_CASE("the same bits for any policy and any call") {
  for (const auto kind : {scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 12, 4, 300, 11);
    for (const auto numbers : {precision::float64, precision::mixed, precision::float32})
      for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg})
        for (const auto damping : {damping_rule::identity, damping_rule::diagonal}) {
          CAPTURE(static_cast<int>(kind));
          CAPTURE(static_cast<int>(numbers));
          CAPTURE(static_cast<int>(solver));
          adjustment_options options = in_float64();
          options.numbers = numbers, options.solver = solver, options.damping = damping;
          const auto a = adjust_scene(sequential{}, s, options);
          CHECK(same(adjust_scene(sequential{}, s, options), a));
          for_each_parallel_policy([&](auto policy) { CHECK(same(adjust_scene(policy, s, options), a)); });
        }
  }
}

TEST_CASE("the same bits with another number of threads") {
  const auto s = make_adjustment_scene(scene_kind::fisheye_rig, 12, 4, 300, 12);
  for (const auto numbers : {precision::float64, precision::mixed})
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
      adjustment_options options = in_float64();
      options.numbers = numbers, options.solver = solver;
      const auto a = adjust_scene(sequential{}, s, options);
      for_each_thread_count([&](int threads) {
        CAPTURE(threads);
        for_each_parallel_policy([&](auto policy) { CHECK(same(adjust_scene(policy, s, options), a)); });
      });
    }
}

/// Bearings, priors and odometry, without any reprojection.
template <class Policy>
adjusted adjust_own_factors(const Policy& policy, const adjustment_scene& s, const adjustment_options& options) {
  using bearings = turbomap::landmark_factors<bearing_factor, turbomap::cauchy>;
  using priors = turbomap::frame_factors<prior_factor>;
  using odometry = turbomap::frame_pair_factors<odometry_factor, turbomap::tukey>;
  const std::vector<std::int32_t> prior_frames{0, 3, 0}, first{0, 2, 2, 5, 4}, second{1, 1, 3, 0, 3};
  std::vector<prior_factor::row> prior_rows;
  for (const auto f : prior_frames) prior_rows.push_back({s.true_poses[static_cast<std::size_t>(f)]});
  const std::vector<odometry_factor::row> odometry_rows(first.size(), {{0.2, 0.02, -0.01}});
  std::vector<bearing_factor::row> bearing_rows;
  for (const auto& p : s.pixel) bearing_rows.push_back({(p.x - 367) / 435, (p.y - 252) / 436});
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, odometry, bearings, priors> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(),
                 {{5.0},
                  span<const std::int32_t>(first),
                  span<const std::int32_t>(second),
                  span<const odometry_factor::row>(odometry_rows),
                  {400.0},
                  1e6},
                 {{200.0},
                  span<const std::int32_t>(s.frame),
                  span<const std::int32_t>(s.landmark),
                  span<const bearing_factor::row>(bearing_rows),
                  {4.0},
                  1e6},
                 {{10.0}, span<const std::int32_t>(prior_frames), span<const prior_factor::row>(prior_rows), {}, 1e6});
  adjusted a;
  a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
  return a;
}

TEST_CASE("factors of the user's own") {
  const auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 60, 5);
  for (const auto solver : {reduced_solver::dense, reduced_solver::pcg}) {
    adjustment_options options = in_float64();
    options.solver = solver, options.max_iterations = 5;
    const auto a = adjust_own_factors(sequential{}, s, options);
    for_each_parallel_policy([&](auto policy) { CHECK(same(adjust_own_factors(policy, s, options), a)); });
  }
}

TEST_CASE("chi2 of every observation, covariance of frames") {
  const auto s = make_adjustment_scene(scene_kind::fisheye_rig, 6, 2, 60, 7);
  const auto chi2_of = [&](const auto& policy) {
    turbomap::context<std::decay_t<decltype(policy)>> ctx{policy};
    turbomap::bundle_problem<std::decay_t<decltype(policy)>, pose_frame, turbomap::reprojections<scene_camera>> problem(
        ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
    std::vector<double> chi2, depth;
    problem.template chi2<0>(ctx, chi2, depth);
    chi2.insert(chi2.end(), depth.begin(), depth.end());
    return chi2;
  };
  const auto chi2 = chi2_of(sequential{});
  for_each_parallel_policy([&](auto policy) { CHECK(same_bits(chi2_of(policy), chi2)); });
  const auto covariance = covariance_of(sequential{}, s, {0, 2});
  REQUIRE(covariance.size() == 144);
  for_each_parallel_policy([&](auto policy) { CHECK(same_bits(covariance_of(policy, s, {0, 2}), covariance)); });
}

TEST_CASE("poses from fixed points") {
  const frames_input in(make_adjustment_scene(scene_kind::fisheye_rig, 6, 0, 60, 8));
  const auto bits = [](const posed& p) {
    std::vector<rigid_transform<double>> poses;
    for (const auto& f : p.frames) poses.push_back(f.T_cw);
    return poses;
  };
  const posed a = adjust_poses(sequential{}, in, {});
  for_each_parallel_policy([&](auto policy) {
    const posed b = adjust_poses(policy, in, {});
    CHECK(same_bits(bits(b), bits(a)));
    CHECK(b.outlier == a.outlier);
  });
}

}  // namespace
