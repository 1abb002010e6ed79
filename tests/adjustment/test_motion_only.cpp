// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Poses from fixed points: against the oracle of bundle adjustment with fixed landmarks, round by round; outliers;
// frames that cannot be adjusted.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cmath>

#include "motion_only_cases.hpp"
#include "reference/adjustment_oracle.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("poses are found among outliers, and outliers told", Policy, TURBOMAP_TEST_POLICIES) {
  check_poses_found(Policy{});
}

TEST_CASE("the pose of the last round is the least squares of its inliers") {
  const frames_input in(make_adjustment_scene(scene_kind::mono, 3, 0, 60, 8));
  motion_only_options options;
  options.rounds = 3;
  const posed before = adjust_poses(sequential{}, in, options);
  options.rounds = 4, options.iterations = 30;
  const posed p = adjust_poses(sequential{}, in, options);
  for (std::size_t f = 0; f < 3; ++f) {
    oracle_problem o;
    const auto& T = in.s.poses[f];
    o.frames.push_back(
        {Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).toRotationMatrix(), {T.tx, T.ty, T.tz}, Eigen::VectorXd(0)});
    o.frame_fixed = {false};
    for (auto i = static_cast<std::size_t>(in.begin[f]); i < static_cast<std::size_t>(in.begin[f + 1]); ++i) {
      if (before.outlier[i] != 0) continue;
      oracle_block b;
      b.frame = 0;
      const auto X = in.point[i];
      const auto z = in.pixel[i];
      const double sigma = std::sqrt(in.information[i]);
      b.e = [=](const oracle_frame& x, const oracle_frame&, const Eigen::Vector3d&) {
        const Eigen::Vector3d q = x.R * Eigen::Vector3d(X.x, X.y, X.z) + x.t;
        return Eigen::VectorXd(sigma *
                               Eigen::Vector2d(435 * q.x() / q.z() + 367 - z.x, 436 * q.y() / q.z() + 252 - z.y));
      };
      b.kernel = [](double chi2, double& rho, double& weight) { rho = chi2, weight = 1; };
      o.blocks.push_back(b);
    }
    oracle_adjust(o, 20);
    const auto got = turbomap::to_isometry<double>(p.frames[f].T_cw);
    CHECK(p.frames[f].cost == doctest::Approx(o.cost()).epsilon(1e-9));
    CHECK((Eigen::Vector3d(got.t.x, got.t.y, got.t.z) - o.frames[0].t).norm() < 1e-6);
    for (int i = 0; i < 9; ++i) CHECK(std::abs(got.R.m[i] - o.frames[0].R(i / 3, i % 3)) < 1e-6);
  }
}

TEST_CASE("without robust rounds outliers pull; what is behind the camera is an outlier") {
  frames_input in(make_adjustment_scene(scene_kind::mono, 3, 0, 60, 8));
  motion_only_options options;
  options.rounds = options.robust_rounds = 1;
  const posed robust = adjust_poses(sequential{}, in, options);
  options.robust_rounds = 0;
  const posed plain = adjust_poses(sequential{}, in, options);
  for (std::size_t f = 0; f < 3; ++f) {
    const auto &a = robust.frames[f], &b = plain.frames[f];
    CHECK(b.cost > 1.5 * a.cost);
    CHECK(pose_error(a.T_cw, in.s.true_poses[f]) < pose_error(b.T_cw, in.s.true_poses[f]));
  }
  const posed before = adjust_poses(sequential{}, in);
  for (int i = 0; i < in.begin[1]; ++i) {  // mirrored through the camera's centre: the same pixels by the formula
    const auto k = static_cast<std::size_t>(i);
    if (i % 5 != 0 || before.outlier[k] != 0) continue;
    const auto T = turbomap::to_isometry<double>(before.frames[0].T_cw);
    const vec3<double> c = turbomap::camera_centre(T), p = in.point[k];
    in.point[k] = {2 * c.x - p.x, 2 * c.y - p.y, 2 * c.z - p.z};
  }
  const posed after = adjust_poses(sequential{}, in);
  for (int i = 0; i < in.begin[1]; i += 5) CHECK(after.outlier[static_cast<std::size_t>(i)] == 1);
}

TEST_CASE_TEMPLATE("frames that cannot be adjusted stay to the bit; the others do not mind", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_poses_refused(Policy{});
}

TEST_CASE_TEMPLATE("bad input is refused", Policy, TURBOMAP_TEST_POLICIES) { check_bad_frames(Policy{}); }

}  // namespace
