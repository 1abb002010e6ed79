// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Poses from fixed points: against the oracle of bundle adjustment with fixed landmarks, round by round; outliers;
// frames
// that cannot be adjusted.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/omp/execution_policy.h>
#include <thrust/system/tbb/execution_policy.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <turbomap/adjustment/motion_only.hpp>

#include "adjustment_cases.hpp"
#include "reference/adjustment_oracle.hpp"

namespace {

using namespace turbomap_test;
using turbomap::motion_only_options;
using turbomap::span;
using sequential = std::decay_t<decltype(thrust::seq)>;
using omp = std::decay_t<decltype(thrust::omp::par)>;
using tbb_policy = std::decay_t<decltype(thrust::tbb::par)>;

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
    turbomap::motion_only_input<scene_camera> in;
    in.rig = s.view(), in.T_cw = span<const rigid_transform<double>>(s.poses),
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

double error(const rigid_transform<double>& a, const rigid_transform<double>& b) {
  const auto x = turbomap::to_isometry<double>(a), y = turbomap::to_isometry<double>(b);
  double d = std::abs(x.t.x - y.t.x) + std::abs(x.t.y - y.t.y) + std::abs(x.t.z - y.t.z);
  for (int i = 0; i < 9; ++i) d = std::max(d, std::abs(x.R.m[i] - y.R.m[i]));
  return d;
}

TEST_CASE_TEMPLATE("poses are found among outliers, and outliers told", Policy, sequential, omp, tbb_policy) {
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    const frames_input in(make_adjustment_scene(kind, 6, 0, 120, 4));
    turbomap::context<Policy> ctx{Policy{}};
    turbomap::motion_only<scene_camera, Policy> adjust(ctx);
    std::vector<turbomap::posed_frame> result;
    std::vector<std::uint8_t> outlier;
    adjust(ctx, in.view(), {}, result, outlier);
    REQUIRE(result.size() == 6);
    REQUIRE(outlier.size() == in.point.size());
    CHECK(std::count(outlier.begin(), outlier.end(), 1) > static_cast<long>(outlier.size()) / 50);
    double before = 0, after = 0;
    for (std::size_t f = 0; f < 6; ++f) {
      CHECK(result[f].adjusted == 1);
      before += error(in.s.poses[f], in.s.true_poses[f]), after += error(result[f].T_cw, in.s.true_poses[f]);
      int inliers = 0;
      for (auto i = static_cast<std::size_t>(in.begin[f]); i < static_cast<std::size_t>(in.begin[f + 1]); ++i)
        inliers += outlier[i] == 0;
      CHECK(result[f].inliers == inliers);
      CHECK(inliers > 0.8 * (in.begin[f + 1] - in.begin[f]));
    }
    CHECK(after < 0.7 * before);
  }
}

TEST_CASE("the pose of the last round is the least squares of its inliers") {
  const frames_input in(make_adjustment_scene(scene_kind::mono, 3, 0, 60, 8));
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::motion_only<scene_camera, sequential> adjust(ctx);
  std::vector<turbomap::posed_frame> result;
  std::vector<std::uint8_t> outlier, before;
  motion_only_options options;
  options.rounds = 3;
  adjust(ctx, in.view(), options, result, before);
  options.rounds = 4, options.iterations = 30;
  adjust(ctx, in.view(), options, result, outlier);
  for (std::size_t f = 0; f < 3; ++f) {
    oracle_problem o;
    const auto& T = in.s.poses[f];
    o.frames.push_back(
        {Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).toRotationMatrix(), {T.tx, T.ty, T.tz}, Eigen::VectorXd(0)});
    o.frame_fixed = {false};
    for (auto i = static_cast<std::size_t>(in.begin[f]); i < static_cast<std::size_t>(in.begin[f + 1]); ++i) {
      if (before[i] != 0) continue;
      oracle_block b;
      b.frame = 0;
      const auto X = in.point[i];
      const auto z = in.pixel[i];
      const double sigma = std::sqrt(in.information[i]);
      b.e = [=](const oracle_frame& x, const oracle_frame&, const Eigen::Vector3d&) {
        const Eigen::Vector3d p = x.R * Eigen::Vector3d(X.x, X.y, X.z) + x.t;
        return Eigen::VectorXd(sigma *
                               Eigen::Vector2d(435 * p.x() / p.z() + 367 - z.x, 436 * p.y() / p.z() + 252 - z.y));
      };
      b.kernel = [](double chi2, double& rho, double& weight) { rho = chi2, weight = 1; };
      o.blocks.push_back(b);
    }
    oracle_adjust(o, 20);
    const auto got = turbomap::to_isometry<double>(result[f].T_cw);
    CHECK(result[f].cost == doctest::Approx(o.cost()).epsilon(1e-9));
    CHECK((Eigen::Vector3d(got.t.x, got.t.y, got.t.z) - o.frames[0].t).norm() < 1e-6);
    for (int i = 0; i < 9; ++i) CHECK(std::abs(got.R.m[i] - o.frames[0].R(i / 3, i % 3)) < 1e-6);
  }
}

TEST_CASE("without robust rounds outliers pull; what is behind the camera is an outlier") {
  frames_input in(make_adjustment_scene(scene_kind::mono, 3, 0, 60, 8));
  turbomap::context<sequential> ctx{sequential{}};
  turbomap::motion_only<scene_camera, sequential> adjust(ctx);
  std::vector<turbomap::posed_frame> robust, plain;
  std::vector<std::uint8_t> outlier;
  motion_only_options options;
  options.rounds = options.robust_rounds = 1;
  adjust(ctx, in.view(), options, robust, outlier);
  options.robust_rounds = 0;
  adjust(ctx, in.view(), options, plain, outlier);
  for (std::size_t f = 0; f < 3; ++f) {
    CHECK(plain[f].cost > 1.5 * robust[f].cost);
    CHECK(error(robust[f].T_cw, in.s.true_poses[f]) < error(plain[f].T_cw, in.s.true_poses[f]));
  }
  options = {};
  adjust(ctx, in.view(), options, plain, outlier);
  for (int i = 0; i < in.begin[1]; ++i) {  // mirrored through the camera's centre: the same pixels by the formula
    const auto k = static_cast<std::size_t>(i);
    if (i % 5 != 0 || outlier[k] != 0) continue;
    const auto T = turbomap::to_isometry<double>(plain[0].T_cw);
    const vec3<double> c = turbomap::camera_centre(T), p = in.point[k];
    in.point[k] = {2 * c.x - p.x, 2 * c.y - p.y, 2 * c.z - p.z};
  }
  adjust(ctx, in.view(), options, robust, outlier);
  for (int i = 0; i < in.begin[1]; i += 5) CHECK(outlier[static_cast<std::size_t>(i)] == 1);
}

TEST_CASE_TEMPLATE("frames that cannot be adjusted stay to the bit; the others do not mind", Policy, sequential, omp) {
  frames_input in(make_adjustment_scene(scene_kind::stereo, 5, 0, 60, 8));
  const auto n = in.point.size();
  for (auto i = static_cast<std::size_t>(in.begin[1]); i < static_cast<std::size_t>(in.begin[2]); ++i)
    in.pixel[i] = {1e5, -1e5, -1};  // all outliers
  in.point[static_cast<std::size_t>(in.begin[2])].x =
      std::numeric_limits<double>::quiet_NaN();  // an outlier like others
  in.pixel[static_cast<std::size_t>(in.begin[3])].x = std::numeric_limits<double>::quiet_NaN();
  in.begin.insert(in.begin.end(), {static_cast<std::int32_t>(n)}),
      in.s.poses.push_back({0, 0, 0, 2, 1, 2, 3});                                 // sees nothing
  in.begin.push_back(static_cast<std::int32_t>(n + 2)), in.s.poses.push_back({});  // too little
  for (int k = 0; k < 2; ++k) in.add(0);
  turbomap::context<Policy> ctx{Policy{}};
  turbomap::motion_only<scene_camera, Policy> adjust(ctx);
  std::vector<turbomap::posed_frame> result;
  std::vector<std::uint8_t> outlier;
  adjust(ctx, in.view(), {}, result, outlier);
  const bool adjusted[] = {true, false, true, false, true, false, false};
  for (std::size_t f = 0; f < 7; ++f) {
    CAPTURE(f);
    CHECK((result[f].adjusted != 0) == adjusted[f]);
    if (!adjusted[f]) CHECK(error(result[f].T_cw, in.s.poses[f]) == 0);
  }
  CHECK(outlier[static_cast<std::size_t>(in.begin[2])] == 1);
  auto bad = in;
  bad.begin[1] = -1;
  CHECK_THROWS_AS(adjust(ctx, bad.view(), {}, result, outlier), std::invalid_argument);
  bad = in, bad.camera[0] = 1;
  CHECK_THROWS_AS(adjust(ctx, bad.view(), {}, result, outlier), std::invalid_argument);
  bad = in, bad.pixel.pop_back();
  CHECK_THROWS_AS(adjust(ctx, bad.view(), {}, result, outlier), std::invalid_argument);
  motion_only_options options;
  options.rounds = 0;
  CHECK_THROWS_AS(adjust(ctx, in.view(), options, result, outlier), std::invalid_argument);
}

}  // namespace
