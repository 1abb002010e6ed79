// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Bundle adjustment on a device: what the host computes within rounding, and the same bits each time.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "adjustment_cases.hpp"
#include "adjustment_factors.hpp"
#include "adjustment_results.hpp"
#include "pair_lists_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::damping_rule;
using turbomap::precision;
using turbomap::reduced_solver;
using sequential = std::decay_t<decltype(thrust::seq)>;

void check_repeated(const adjusted& a, const adjusted& again) {
  CHECK(same_bits(a.summary, again.summary));
  CHECK(same_bits(a.poses, again.poses));
  CHECK(same_bits(a.points, again.points));
}
/// In float64.
void check_as_host(const adjusted& a, const adjusted& host) {
  REQUIRE(a.summary.each.size() == host.summary.each.size());
  CHECK(a.summary.accepted == host.summary.accepted);
  CHECK(std::abs(a.summary.cost_initial - host.summary.cost_initial) <= 1e-12 * host.summary.cost_initial);
  for (std::size_t i = 0; i < host.summary.each.size(); ++i)
    CHECK(std::abs(a.summary.each[i].cost - host.summary.each[i].cost) <= 1e-9 * host.summary.each[i].cost);
  CHECK(std::abs(a.summary.cost_final - host.summary.cost_final) <= 1e-9 * host.summary.cost_final);
  CHECK(distance(a.poses, host.poses) <= 1e-9);
  CHECK(distance(a.points, host.points) <= 1e-9);
}

TEST_CASE("every kind of observation, solver and kind of numbers: as on the host") {
  const stream on;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 9, 2, 200, 7);
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg})
      for (const auto numbers : {precision::float64, precision::mixed, precision::float32})
        for (const auto damping : {damping_rule::identity, damping_rule::diagonal}) {
          CAPTURE(static_cast<int>(kind));
          CAPTURE(static_cast<int>(solver));
          CAPTURE(static_cast<int>(numbers));
          CAPTURE(static_cast<int>(damping));
          adjustment_options options = in_float64();
          options.solver = solver, options.numbers = numbers, options.damping = damping;
          options.pcg_tolerance = 1e-13, options.max_iterations = 5;
          const auto host = adjust_scene(sequential{}, s, options), a = adjust_scene(on.policy(), s, options);
          check_repeated(a, adjust_scene(on.policy(), s, options));
          if (numbers == precision::float64) {
            check_as_host(a, host);
          } else {
            REQUIRE(a.summary.each.size() == host.summary.each.size());
            CHECK(a.summary.cost_initial == doctest::Approx(host.summary.cost_initial).epsilon(1e-5));
            CHECK(a.summary.cost_final == doctest::Approx(host.summary.cost_final).epsilon(1e-5));
            CHECK(distance(a.poses, host.poses) <= 1e-3);
          }
        }
  }
}

TEST_CASE("a window of a thousand landmarks") {
  const stream on;
  const auto s = make_adjustment_scene(scene_kind::stereo, 24, 4, 1000, 3);
  adjustment_options options = in_float64();
  options.max_iterations = 5;
  const auto a = adjust_scene(on.policy(), s, options);
  check_as_host(a, adjust_scene(sequential{}, s, options));
  check_repeated(a, adjust_scene(on.policy(), s, options));
}

TEST_CASE("factors of one's own") {
  const stream on;
  const auto s = make_adjustment_scene(scene_kind::mono, 6, 1, 60, 5);
  std::vector<std::int32_t> prior_frames{0, 3, 0}, first{0, 2, 2, 5, 4}, second{1, 1, 3, 0, 3};
  std::vector<prior_factor::row> priors;
  for (const auto f : prior_frames) priors.push_back({s.true_poses[static_cast<std::size_t>(f)]});
  const std::vector<odometry_factor::row> odometry(first.size(), {{0.2, 0.02, -0.01}});
  std::vector<bearing_factor::row> bearings;
  for (const auto& p : s.pixel) bearings.push_back({(p.x - 367) / 435, (p.y - 252) / 436});
  using bearing_group = turbomap::landmark_factors<bearing_factor, turbomap::cauchy>;
  using prior_group = turbomap::frame_factors<prior_factor>;
  using odometry_group = turbomap::frame_pair_factors<odometry_factor, turbomap::tukey>;
  const bearing_group g{{200.0},
                        {s.frame.data(), s.frame.size()},
                        {s.landmark.data(), s.landmark.size()},
                        {bearings.data(), bearings.size()},
                        {4.0},
                        1e6};
  const prior_group h{{10.0}, {prior_frames.data(), 3}, {priors.data(), 3}, {}, 1e6};
  const odometry_group k{{5.0}, {first.data(), 5}, {second.data(), 5}, {odometry.data(), 5}, {400.0}, 1e6};
  const auto run = [&](const auto& policy, reduced_solver solver) {
    using policy_type = std::decay_t<decltype(policy)>;
    turbomap::context<policy_type> ctx{policy};
    turbomap::bundle_problem<policy_type, pose_frame, odometry_group, bearing_group, prior_group> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), k, g, h);
    adjustment_options options = in_float64();
    options.max_iterations = 5, options.solver = solver, options.pcg_tolerance = 1e-13;
    adjusted a;
    a.summary = turbomap::adjust<float64_methods>(ctx, problem, options);
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    return a;
  };
  for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
    CAPTURE(static_cast<int>(solver));
    const auto device = run(on.policy(), solver);
    check_as_host(device, run(sequential{}, solver));
    check_repeated(device, run(on.policy(), solver));
  }
}

TEST_CASE("conjugate gradients list no pairs: memory of the device grows with the observations") {
  const stream on;
  byte_counting_resource resource(turbomap::default_resource(turbomap::device_memory{}));
  check_pcg_lists_no_pairs(on.policy(), &resource, [&] { return resource.bytes; });
}

TEST_CASE("chi2 and depth of every observation") {
  const stream on;
  const auto s = make_adjustment_scene(scene_kind::fisheye_rig, 5, 2, 50, 7);
  const auto run = [&](const auto& policy, std::vector<double>& chi2, std::vector<double>& depth) {
    using policy_type = std::decay_t<decltype(policy)>;
    turbomap::context<policy_type> ctx{policy};
    turbomap::bundle_problem<policy_type, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
    problem.template chi2<0>(ctx, chi2, depth);
  };
  std::vector<double> chi2[3], depth[3];
  run(sequential{}, chi2[0], depth[0]);
  run(on.policy(), chi2[1], depth[1]);
  run(on.policy(), chi2[2], depth[2]);
  CHECK(same_bits(chi2[1], chi2[2]));
  CHECK(same_bits(depth[1], depth[2]));
  REQUIRE(chi2[1].size() == s.frame.size());
  REQUIRE(depth[1].size() == s.frame.size());
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    CHECK(chi2[1][i] == doctest::Approx(chi2[0][i]).epsilon(1e-9));
    CHECK(depth[1][i] == doctest::Approx(depth[0][i]).epsilon(1e-12));
  }
}

TEST_CASE("degenerate problems end with a reason") {
  const stream on;
  auto s = make_adjustment_scene(scene_kind::stereo, 4, 1, 12, 2);
  auto empty = make_adjustment_scene(scene_kind::stereo, 0, 0, 0, 2);
  CHECK(adjust_scene(on.policy(), empty, {}).summary.end == adjustment_end::no_observations);
  s.information.assign(s.information.size(), 0);
  const auto a = adjust_scene(on.policy(), s, {});
  CHECK(a.summary.end == adjustment_end::converged);
  CHECK(distance(a, adjusted{{}, s.poses, s.points}) == 0);
}

}  // namespace
