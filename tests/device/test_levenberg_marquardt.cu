// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Bundle adjustment on a device: what the host computes within rounding, and the same bits each time.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <turbomap/adjustment/motion_only.hpp>

#include "../adjustment_cases.hpp"
#include "../adjustment_factors.hpp"
#include "stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::adjustment_end;
using turbomap::adjustment_options;
using turbomap::precision;
using turbomap::reduced_solver;
using turbomap::span;
using sequential = std::decay_t<decltype(thrust::seq)>;

TEST_CASE("every kind of observation, solver and kind of numbers: as on the host") {
  const stream on;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    const auto s = make_adjustment_scene(kind, 9, 2, 200, 7);
    for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg})
      for (const auto numbers : {precision::float64, precision::mixed, precision::float32}) {
        CAPTURE(static_cast<int>(kind));
        CAPTURE(static_cast<int>(solver));
        CAPTURE(static_cast<int>(numbers));
        adjustment_options options;
        options.solver = solver, options.numbers = numbers, options.pcg_tolerance = 1e-13;
        options.max_iterations = 5;
        const auto host = adjust_scene(sequential{}, s, options), a = adjust_scene(on.policy(), s, options);
        const bool exact = numbers == precision::float64;
        REQUIRE(a.summary.each.size() == host.summary.each.size());
        CHECK(a.summary.cost_initial == doctest::Approx(host.summary.cost_initial).epsilon(exact ? 1e-12 : 1e-5));
        CHECK(a.summary.cost_final == doctest::Approx(host.summary.cost_final).epsilon(exact ? 1e-9 : 1e-4));
        if (exact) CHECK(distance(a, host) < 1e-8);
        const auto again = adjust_scene(on.policy(), s, options);
        CHECK(distance(a, again) == 0);
        CHECK(a.summary.cost_final == again.summary.cost_final);
      }
  }
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
    adjustment_options options;
    options.max_iterations = 5, options.solver = solver, options.pcg_tolerance = 1e-13;
    adjusted a;
    a.summary = turbomap::adjust(ctx, problem, options);
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    return a;
  };
  for (const auto solver : {reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg}) {
    const auto host = run(sequential{}, solver), device = run(on.policy(), solver);
    CHECK(device.summary.cost_final == doctest::Approx(host.summary.cost_final).epsilon(1e-9));
    CHECK(distance(host, device) < 1e-8);
  }
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
  std::vector<double> chi2[2], depth[2];
  run(sequential{}, chi2[0], depth[0]);
  run(on.policy(), chi2[1], depth[1]);
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

TEST_CASE("poses alone: as on the host") {
  const stream on;
  const auto s = make_adjustment_scene(scene_kind::stereo, 30, 0, 100, 4);
  std::vector<std::int32_t> begin{0};
  std::vector<vec3<double>> point;
  for (std::size_t i = 0; i < s.frame.size(); ++i) {  // frames come in order
    while (static_cast<int>(begin.size()) <= s.frame[i]) begin.push_back(static_cast<std::int32_t>(i));
    point.push_back(s.true_points[static_cast<std::size_t>(s.landmark[i])]);
  }
  while (begin.size() <= s.poses.size()) begin.push_back(static_cast<std::int32_t>(point.size()));
  turbomap::motion_only_input<scene_camera> in;
  in.rig = s.view(), in.T_cw = span<const rigid_transform<double>>(s.poses), in.begin = span<const std::int32_t>(begin);
  in.point = span<const vec3<double>>(point), in.pixel = span<const vec3<double>>(s.pixel);
  in.information = span<const double>(s.information), in.camera = span<const std::uint8_t>(s.camera);
  const auto run = [&](const auto& policy, std::vector<std::uint8_t>& outlier) {
    using policy_type = std::decay_t<decltype(policy)>;
    turbomap::context<policy_type> ctx{policy};
    turbomap::motion_only<scene_camera, policy_type> adjust(ctx);
    std::vector<turbomap::posed_frame> result;
    adjust(ctx, in, {}, result, outlier);
    return result;
  };
  std::vector<std::uint8_t> outlier[2];
  const auto host = run(sequential{}, outlier[0]), device = run(on.policy(), outlier[1]);
  CHECK(outlier[0] == outlier[1]);
  for (std::size_t f = 0; f < host.size(); ++f) {
    CHECK(host[f].adjusted == device[f].adjusted);
    CHECK(std::abs(host[f].T_cw.tx - device[f].T_cw.tx) < 1e-8);
    CHECK(std::abs(host[f].T_cw.qy - device[f].T_cw.qy) < 1e-8);
  }
}

}  // namespace
