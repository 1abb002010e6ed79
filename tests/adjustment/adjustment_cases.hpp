// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small scene to adjust, and what must hold of it under every policy.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

using turbomap::pose_frame;
using turbomap::rigid_transform;
using turbomap::vec2;
using turbomap::vec3;
using scene_camera = turbomap::any_camera<turbomap::pinhole<double>, turbomap::kannala_brandt<double>>;

/// Poses around a cloud of points, as true and as disturbed; observations with noise and a few outliers.
struct adjustment_scene {
  std::vector<turbomap::rig_camera<scene_camera>> rig;
  std::vector<rigid_transform<double>> poses, true_poses;
  std::vector<std::uint8_t> fixed;
  std::vector<vec3<double>> points, true_points;
  std::vector<std::int32_t> frame, landmark;
  std::vector<vec3<double>> pixel;
  std::vector<double> information;
  std::vector<std::uint8_t> camera;

  turbomap::rig_view<scene_camera> view() const { return {rig.data(), static_cast<int>(rig.size())}; }
  turbomap::reprojections<scene_camera> group() const {
    auto g = turbomap::huber_reprojections(view());
    g.frame = turbomap::span<const std::int32_t>(frame), g.landmark = turbomap::span<const std::int32_t>(landmark);
    g.pixel = turbomap::span<const vec3<double>>(pixel), g.information = turbomap::span<const double>(information);
    g.camera = turbomap::span<const std::uint8_t>(camera);
    return g;
  }
  turbomap::frame_input<pose_frame> frame_input() const {
    return {turbomap::span<const rigid_transform<double>>(poses), turbomap::span<const std::uint8_t>(fixed)};
  }
  turbomap::landmark_input landmark_input() const { return {turbomap::span<const vec3<double>>(points), {}}; }
};

enum class scene_kind { mono, stereo, fisheye_rig };

inline adjustment_scene make_adjustment_scene(scene_kind kind, int frames, int fixed, int points, unsigned seed) {
  using turbomap::operator*;
  adjustment_scene s;
  const turbomap::pinhole<double> straight{435, 436, 367, 252};
  const turbomap::kannala_brandt<double> curved{190.9, 191.4, 367, 252, 0.0034, 0.0007, -0.002, 0.0002};
  if (kind == scene_kind::fisheye_rig) {
    const double turn[6] = {0.01, 0.05, -0.02, -0.1, 0.002, 0.003};
    s.rig = {{curved, {}, 0, {}}, {curved, turbomap::left_exp(turn, rigid_transform<double>{}), 0, {}}};
  } else {
    s.rig = {{straight, {}, kind == scene_kind::stereo ? 47.9 : 0.0, {}}};
  }
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, 1);
  for (int l = 0; l < points; ++l) {
    s.true_points.push_back({3 * uniform(random), 2 * uniform(random), 5 + 2 * uniform(random)});
    const auto& p = s.true_points.back();
    s.points.push_back({p.x + 0.03 * normal(random), p.y + 0.03 * normal(random), p.z + 0.03 * normal(random)});
  }
  for (int f = 0; f < frames; ++f) {
    const double truth[6] = {0.05 * uniform(random), 0.05 * uniform(random), 0.05 * uniform(random),
                             1.5 * f / frames - 0.7, 0.3 * uniform(random),  0.3 * uniform(random)};
    double error[6];
    for (double& e : error) e = 0.01 * normal(random);
    s.true_poses.push_back(turbomap::left_exp(truth, rigid_transform<double>{}));
    s.fixed.push_back(f >= frames - fixed ? 1 : 0);
    s.poses.push_back(s.fixed.back() ? s.true_poses.back() : turbomap::left_exp(error, s.true_poses.back()));
    for (int l = 0; l < points; ++l)
      for (std::size_t c = 0; c < s.rig.size(); ++c) {
        const vec3<double> body =
            turbomap::to_isometry<double>(s.true_poses.back()) * s.true_points[static_cast<std::size_t>(l)];
        const vec3<double> p = turbomap::to_isometry<double>(s.rig[c].T_camera_body) * body;
        vec2<double> q{};
        if (uniform(random) < -0.2 || p.z < 0.5 || !s.rig[c].camera.project(p, q)) continue;
        const double outlier = uniform(random) > 0.94 ? 30 : 1;
        const bool right = kind == scene_kind::stereo && uniform(random) < 0.6;
        s.frame.push_back(f), s.landmark.push_back(l), s.camera.push_back(static_cast<std::uint8_t>(c));
        s.pixel.push_back({q.x + outlier * normal(random), q.y + outlier * normal(random),
                           right ? q.x - s.rig[c].bf / p.z + normal(random) : -1});
        s.information.push_back(std::pow(1.44, -static_cast<int>(random() % 5)));
      }
  }
  return s;
}

using float64_methods = turbomap::adjustment_methods<turbomap::adjustment_methods<>::solvers,
                                                     turbomap::precision_list<turbomap::precision::float64>>;

/// Options of an adjustment that is compared with an oracle.
inline turbomap::adjustment_options in_float64() {
  turbomap::adjustment_options options;
  options.damping = turbomap::damping_rule::identity;
  options.numbers = turbomap::precision::float64;
  return options;
}

/// What an adjustment under a policy gives.
struct adjusted {
  turbomap::adjustment_summary summary;
  std::vector<rigid_transform<double>> poses;
  std::vector<vec3<double>> points;
};

template <class Policy>
adjusted adjust_scene(const Policy& policy, const adjustment_scene& s, const turbomap::adjustment_options& options) {
  turbomap::context<Policy> ctx{policy};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  adjusted a;
  a.summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
  problem.frames(ctx, a.poses);
  problem.landmarks(ctx, a.points);
  return a;
}

/// The largest difference of a number of poses and points. NaN where a result holds one.
inline double distance(const adjusted& a, const adjusted& b) {
  if (a.poses.size() != b.poses.size() || a.points.size() != b.points.size()) return HUGE_VAL;
  double d = 0;
  for (std::size_t f = 0; f < a.poses.size(); ++f) {
    const double p[7] = {a.poses[f].qx, a.poses[f].qy, a.poses[f].qz, a.poses[f].qw,
                         a.poses[f].tx, a.poses[f].ty, a.poses[f].tz};
    const double q[7] = {b.poses[f].qx, b.poses[f].qy, b.poses[f].qz, b.poses[f].qw,
                         b.poses[f].tx, b.poses[f].ty, b.poses[f].tz};
    for (int i = 0; i < 7; ++i) d = larger_or_nan(d, std::abs(p[i] - q[i]));
  }
  for (std::size_t l = 0; l < a.points.size(); ++l)
    for (const double x : {a.points[l].x - b.points[l].x, a.points[l].y - b.points[l].y, a.points[l].z - b.points[l].z})
      d = larger_or_nan(d, std::abs(x));
  return d;
}

}  // namespace turbomap_test
