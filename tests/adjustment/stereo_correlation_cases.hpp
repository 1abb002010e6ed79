// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Stereo rows whose u_right errs with u, and what must hold of adjustments that know it, under every policy.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "adjustment_cases.hpp"
#include "motion_only_cases.hpp"

namespace turbomap_test {

/// u_right becomes what matching the left keypoint's patch gives: u with its error, less a disparity that errs by
/// `disparity_sigma` sigma.
inline void match_right(adjustment_scene& s, double disparity_sigma) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < s.pixel.size(); ++i) {
    if (s.pixel[i].z < 0) continue;
    const auto T = turbomap::to_isometry<double>(s.true_poses[static_cast<std::size_t>(s.frame[i])]);
    const vec3<double> x = T * s.true_points[static_cast<std::size_t>(s.landmark[i])];
    const double sigma = disparity_sigma / std::sqrt(s.information[i]);
    s.pixel[i].z = s.pixel[i].x - s.rig[0].bf / x.z + sigma * normal(random);
  }
}

/// chi2 of a stereo row by the inverse of its covariance [1 0 r; 0 1 0; r 0 1] / information, by hand.
inline double correlated_chi2(const adjustment_scene& s, std::size_t row, const rigid_transform<double>& T_cw,
                              const vec3<double>& point, double r) {
  const vec3<double> x = turbomap::to_isometry<double>(T_cw) * point;
  vec2<double> q{};
  REQUIRE(s.rig[0].camera.project(x, q));
  const double u = s.pixel[row].x - q.x, v = s.pixel[row].y - q.y;
  if (s.pixel[row].z < 0) return s.information[row] * (u * u + v * v);
  const double w = s.pixel[row].z - (q.x - s.rig[0].bf / x.z);
  return s.information[row] * (v * v + (u * u - 2 * r * u * w + w * w) / (1 - r * r));
}

/// chi2 of every row at the end of an adjustment is that of the covariance.
template <class Policy>
void check_correlated_adjustment(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::stereo, 8, 2, 150, 5);
  match_right(s, 0.2);
  for (const double r : {0.0, 0.98}) {
    CAPTURE(r);
    turbomap::context<Policy> ctx{policy};
    turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    auto group = s.group();
    group.stereo_correlation = r;
    problem.assign(ctx, s.frame_input(), s.landmark_input(), group);
    turbomap::adjustment_options options = in_float64();
    options.max_iterations = 30;
    const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
    adjusted a;
    problem.frames(ctx, a.poses), problem.landmarks(ctx, a.points);
    std::vector<double> chi2, depth;
    problem.template chi2<0>(ctx, chi2, depth);
    double cost = 0;
    REQUIRE(chi2.size() == s.pixel.size());
    for (std::size_t i = 0; i < chi2.size(); ++i) {
      const double expected = correlated_chi2(s, i, a.poses[static_cast<std::size_t>(s.frame[i])],
                                              a.points[static_cast<std::size_t>(s.landmark[i])], r);
      CHECK(chi2[i] == doctest::Approx(expected).epsilon(1e-9));
      const double d2 = s.pixel[i].z >= 0 ? 7.815 : 5.991;
      cost += expected <= d2 ? expected : 2 * std::sqrt(d2 * expected) - d2;
    }
    CHECK(summary.cost_final == doctest::Approx(cost).epsilon(1e-9));
    CHECK(summary.cost_final < 0.8 * summary.cost_initial);
  }
}

/// Two keyframes, one of them fixed, that share a few points: what is known of the noise makes the step better.
template <class Policy>
void check_weak_link(const Policy& policy) {
  double error[2] = {0, 0};
  for (unsigned seed = 1; seed <= 20; ++seed) {
    auto s = make_adjustment_scene(scene_kind::stereo, 2, 1, 60, seed);
    match_right(s, 0.2);
    for (const double r : {0.0, 0.98}) {
      turbomap::context<Policy> ctx{policy};
      turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
      auto group = s.group();
      group.stereo_correlation = r;
      problem.assign(ctx, s.frame_input(), s.landmark_input(), group);
      turbomap::adjustment_options options = in_float64();
      options.max_iterations = 30;
      turbomap::adjust<float64_methods>(ctx, problem, options);
      std::vector<rigid_transform<double>> poses;
      problem.frames(ctx, poses);
      for (std::size_t f = 0; f < 2; ++f) error[r > 0 ? 1 : 0] += pose_error(poses[f], s.true_poses[f]);
    }
  }
  CHECK(error[1] < 0.8 * error[0]);
}

/// The same of poses alone: outliers are told by the covariance, too.
template <class Policy>
void check_correlated_poses(const Policy& policy) {
  auto s = make_adjustment_scene(scene_kind::stereo, 10, 0, 120, 6);
  match_right(s, 0.2);
  const frames_input in(s);
  motion_only_options options;
  options.stereo_correlation = 0.98;
  const posed p = adjust_poses(policy, in, options);
  for (std::size_t f = 0; f < 10; ++f) {
    CHECK(p.frames[f].adjusted == 1);
    for (auto i = static_cast<std::size_t>(in.begin[f]); i < static_cast<std::size_t>(in.begin[f + 1]); ++i) {
      adjustment_scene one = s;
      one.pixel = {in.pixel[i]}, one.information = {in.information[i]};
      const double chi2 = correlated_chi2(one, 0, p.frames[f].T_cw, in.point[i], 0.98);
      const double gate = in.pixel[i].z >= 0 ? options.stereo_chi2 : options.mono_chi2;
      if (std::abs(chi2 - gate) > 1e-6) CHECK((p.outlier[i] != 0) == (chi2 > gate));
    }
  }
}

/// A correlation that is none is refused, by name.
template <class Policy>
void check_bad_correlations(const Policy& policy) {
  const auto s = make_adjustment_scene(scene_kind::stereo, 3, 1, 30, 5);
  const frames_input in(s);
  for (const double bad : {-0.1, 1.0, 2.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto names_it = [](const std::invalid_argument& e) {
      return std::string(e.what()).find("stereo_correlation") != std::string::npos;
    };
    turbomap::context<Policy> ctx{policy};
    turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
    auto group = s.group();
    group.stereo_correlation = bad;
    motion_only_options options;
    options.stereo_correlation = bad;
    int refused = 0;
    try {
      problem.assign(ctx, s.frame_input(), s.landmark_input(), group);
    } catch (const std::invalid_argument& e) {
      refused += names_it(e) ? 1 : 0;
    }
    try {
      adjust_poses(policy, in, options);
    } catch (const std::invalid_argument& e) {
      refused += names_it(e) ? 1 : 0;
    }
    CHECK(refused == 2);
  }
}

}  // namespace turbomap_test
