// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Frames to adjust to fixed points, and what must hold of their poses under every policy.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include <turbomap/adjustment/motion_only.hpp>

#include "adjustment_cases.hpp"
#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

using turbomap::motion_only_options;

/// The observations of a scene, frame by frame, with the true points.
struct frames_input {
  explicit frames_input(adjustment_scene scene) : s(std::move(scene)) {
    begin.push_back(0);
    for (std::size_t f = 0; f < s.poses.size(); ++f) {
      for (std::size_t i = 0; i < s.frame.size(); ++i)
        if (s.frame[i] == static_cast<int>(f)) add(i);
      begin.push_back(static_cast<std::int32_t>(point.size()));
    }
  }
  void add(std::size_t i) {
    point.push_back(s.true_points[static_cast<std::size_t>(s.landmark[i])]), pixel.push_back(s.pixel[i]);
    information.push_back(s.information[i]), camera.push_back(s.camera[i]);
  }
  turbomap::motion_only_input<scene_camera> view() const {
    using turbomap::span;
    turbomap::motion_only_input<scene_camera> in;
    in.rig = s.view(), in.T_cw = span<const rigid_transform<double>>(s.poses);
    in.begin = span<const std::int32_t>(begin);
    in.point = span<const vec3<double>>(point), in.pixel = span<const vec3<double>>(pixel);
    in.information = span<const double>(information), in.camera = span<const std::uint8_t>(camera);
    return in;
  }
  adjustment_scene s;
  std::vector<std::int32_t> begin;
  std::vector<vec3<double>> point, pixel;
  std::vector<double> information;
  std::vector<std::uint8_t> camera;
};

/// What an adjustment under a policy gives.
struct posed {
  std::vector<turbomap::posed_frame> frames;
  std::vector<std::uint8_t> outlier;
};

template <class Policy>
posed adjust_poses(const Policy& policy, const frames_input& in, const motion_only_options& options = {}) {
  turbomap::context<Policy> ctx{policy};
  turbomap::motion_only<scene_camera, Policy> adjust(ctx);
  posed p;
  adjust(ctx, in.view(), options, p.frames, p.outlier);
  return p;
}

/// How far two poses are apart: metres, and the elements of their rotations.
inline double pose_error(const rigid_transform<double>& a, const rigid_transform<double>& b) {
  const auto x = turbomap::to_isometry<double>(a), y = turbomap::to_isometry<double>(b);
  double d = std::abs(x.t.x - y.t.x) + std::abs(x.t.y - y.t.y) + std::abs(x.t.z - y.t.z);
  for (int i = 0; i < 9; ++i) d = larger_or_nan(d, std::abs(x.R.m[i] - y.R.m[i]));
  return d;
}

/// Poses are found among outliers, and outliers told.
template <class Policy>
void check_poses_found(const Policy& policy) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const frames_input in(make_adjustment_scene(kind, 6, 0, 120, 4));
    const posed p = adjust_poses(policy, in);
    REQUIRE(p.frames.size() == 6);
    REQUIRE(p.outlier.size() == in.point.size());
    CHECK(std::count(p.outlier.begin(), p.outlier.end(), 1) > static_cast<long>(p.outlier.size()) / 50);
    double before = 0, after = 0;
    for (std::size_t f = 0; f < 6; ++f) {
      CHECK(p.frames[f].adjusted == 1);
      before += pose_error(in.s.poses[f], in.s.true_poses[f]);
      after += pose_error(p.frames[f].T_cw, in.s.true_poses[f]);
      int inliers = 0;
      for (auto i = static_cast<std::size_t>(in.begin[f]); i < static_cast<std::size_t>(in.begin[f + 1]); ++i)
        inliers += p.outlier[i] == 0;
      CHECK(p.frames[f].inliers == inliers);
      CHECK(inliers > 0.8 * (in.begin[f + 1] - in.begin[f]));
    }
    CHECK(after < 0.7 * before);
  }
}

/// Taking the last step as it is, poses do not depend on the order in which observations are summed; by default the rounding of
/// the cost decides about steps of some 1e-9 m.
template <class Policy>
void check_last_step(const Policy& policy) {
  const frames_input in(make_adjustment_scene(scene_kind::stereo, 200, 0, 60, 9));
  frames_input back = in;
  for (std::size_t f = 0; f < in.s.poses.size(); ++f) {
    const auto reverse = [&](auto& x) { std::reverse(x.begin() + in.begin[f], x.begin() + in.begin[f + 1]); };
    reverse(back.point), reverse(back.pixel), reverse(back.information), reverse(back.camera);
  }
  motion_only_options options;
  options.min_predicted_decrease = 1e-12, options.take_last_step = true;
  const posed a = adjust_poses(policy, in, options), b = adjust_poses(policy, back, options);
  const posed usual = adjust_poses(policy, in);
  for (std::size_t f = 0; f < a.frames.size(); ++f) {
    CAPTURE(f);
    CHECK(a.frames[f].inliers == b.frames[f].inliers);
    CHECK(pose_error(a.frames[f].T_cw, b.frames[f].T_cw) <= 1e-12);
    CHECK(pose_error(a.frames[f].T_cw, usual.frames[f].T_cw) <= 5e-8);
  }
  for (const double bad : {-1., 1e-5, std::numeric_limits<double>::quiet_NaN()}) {
    options.min_predicted_decrease = bad;
    CHECK_THROWS_AS(adjust_poses(policy, in, options), std::invalid_argument);
  }
  options = {};
  for (const double bad : {-1., std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    options.initial_lambda_scale = bad;
    CHECK_THROWS_AS(adjust_poses(policy, in, options), std::invalid_argument);
  }
}

/// Frames that cannot be adjusted: all outliers (1), not a number (3), no observation (5), too few (6), no rotation (7, 8).
/// Frame 2 sees a point that is not a number: an outlier like others.
inline frames_input frames_to_refuse() {
  frames_input in(make_adjustment_scene(scene_kind::stereo, 5, 0, 60, 8));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<std::int32_t>(in.point.size());
  for (auto i = static_cast<std::size_t>(in.begin[1]); i < static_cast<std::size_t>(in.begin[2]); ++i)
    in.pixel[i] = {1e5, -1e5, -1};
  in.point[static_cast<std::size_t>(in.begin[2])].x = nan;
  in.pixel[static_cast<std::size_t>(in.begin[3])].x = nan;
  in.begin.push_back(n), in.s.poses.push_back({0, 0, 0, 2, 1, 2, 3});
  in.begin.push_back(n + 2), in.s.poses.push_back({});
  for (int k = 0; k < 2; ++k) in.add(0);
  // What frame 0 sees, in its own axes: the formula of a rotation makes the identity, which fits, of a quaternion of zeros.
  const auto T = turbomap::to_isometry<double>(in.s.poses[0]);
  for (const double q : {0.0, 1e200}) {
    for (std::size_t i = 0; i < in.s.frame.size(); ++i)
      if (in.s.frame[i] == 0) in.add(i), in.point.back() = T * in.point.back();
    in.begin.push_back(static_cast<std::int32_t>(in.point.size()));
    in.s.poses.push_back({0, 0, 0, q, 0, 0, 0});
  }
  return in;
}

/// They stay to the bit; the others do not mind.
template <class Policy>
void check_poses_refused(const Policy& policy) {
  const frames_input in = frames_to_refuse();
  const posed p = adjust_poses(policy, in);
  const bool adjusted[] = {true, false, true, false, true, false, false, false, false};
  REQUIRE(p.frames.size() == 9);
  for (std::size_t f = 0; f < 9; ++f) {
    CAPTURE(f);
    CHECK((p.frames[f].adjusted != 0) == adjusted[f]);
    if (!adjusted[f]) CHECK(pose_error(p.frames[f].T_cw, in.s.poses[f]) == 0);
  }
  CHECK(p.outlier[static_cast<std::size_t>(in.begin[2])] == 1);
}

/// Rows of information 0 are no observations: two others are too few, also with rows that nobody could fit.
template <class Policy>
void check_rows_of_no_information(const Policy& policy) {
  frames_input in(make_adjustment_scene(scene_kind::stereo, 2, 0, 60, 8));
  const auto first = static_cast<std::size_t>(in.begin[1]), all = in.point.size();
  REQUIRE(first > 10);
  for (std::size_t i = 2; i < first; ++i) in.information[i] = 0;
  in.pixel[2].x = std::numeric_limits<double>::quiet_NaN();
  in.information[all - 1] = 0, in.pixel[all - 1] = {1e5, -1e5, -1};
  for (const bool exact : {true, false}) {
    CAPTURE(exact);
    const std::vector<turbomap::point_covariance> covariance(all, {1e-4F, 0, 1e-4F, 0, 0, 1e-4F});
    turbomap::motion_only_input<scene_camera> given = in.view();
    if (!exact) given.covariance = turbomap::span<const turbomap::point_covariance>(covariance);
    turbomap::context<Policy> ctx{policy};
    turbomap::motion_only<scene_camera, Policy> adjust(ctx);
    posed p;
    adjust(ctx, given, {}, p.frames, p.outlier);
    CHECK(p.frames[0].adjusted == 0);
    CHECK(p.frames[0].inliers == 0);
    CHECK(pose_error(p.frames[0].T_cw, in.s.poses[0]) == 0);
    CHECK(std::count(p.outlier.begin(), p.outlier.begin() + in.begin[1], 1) == 2);  // those that are observations
    CHECK(p.frames[1].adjusted == 1);
    CHECK(p.frames[1].inliers + std::count(p.outlier.begin() + in.begin[1], p.outlier.end(), 1) ==
          in.begin[2] - in.begin[1] - 1);
    CHECK(p.outlier[all - 1] == 0);
  }
  in.information[5] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH_AS(adjust_poses(policy, in), doctest::Contains("information"), std::invalid_argument);
}

/// Bad input is refused.
template <class Policy>
void check_bad_frames(const Policy& policy) {
  const frames_input in(make_adjustment_scene(scene_kind::stereo, 5, 0, 60, 8));
  auto bad = in;
  bad.begin[1] = -1;
  CHECK_THROWS_AS(adjust_poses(policy, bad), std::invalid_argument);
  bad = in, bad.begin[0] = 1;
  CHECK_THROWS_WITH_AS(adjust_poses(policy, bad), "turbomap: begin[0] = 1: must be 0", std::invalid_argument);
  bad = in, --bad.begin.back();
  CHECK_THROWS_WITH_AS(adjust_poses(policy, bad), doctest::Contains("must be the number of observations"),
                       std::invalid_argument);
  bad = in, bad.camera[0] = 1;
  CHECK_THROWS_AS(adjust_poses(policy, bad), std::invalid_argument);
  bad = in, bad.pixel.pop_back();
  CHECK_THROWS_AS(adjust_poses(policy, bad), std::invalid_argument);
  motion_only_options options;
  options.rounds = 0;
  CHECK_THROWS_AS(adjust_poses(policy, in, options), std::invalid_argument);
}

}  // namespace turbomap_test
