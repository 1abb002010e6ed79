// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses from points that are not exact: against an oracle, and against what comes out when they are taken for exact.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <vector>

#include "reference/adjustment_oracle.hpp"
#include "reference/uncertainty_oracle.hpp"
#include "support/policies.hpp"
#include "uncertain_points_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap_test::sequential;

TEST_CASE_TEMPLATE("covariances of points make poses better and keep true observations", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_uncertain_poses(Policy{});
}
TEST_CASE_TEMPLATE("points that err do not shorten a camera's step", Policy, TURBOMAP_TEST_POLICIES) {
  check_unbiased_step(Policy{});
}
TEST_CASE_TEMPLATE("covariances of zero say what none says", Policy, TURBOMAP_TEST_POLICIES) {
  check_exact_covariances(Policy{});
}
TEST_CASE_TEMPLATE("observations of no information say nothing", Policy, TURBOMAP_TEST_POLICIES) {
  check_no_information(Policy{});
}
TEST_CASE_TEMPLATE("covariances that cannot be are refused", Policy, TURBOMAP_TEST_POLICIES) {
  check_bad_covariances(Policy{});
}

/// One observation of the oracle: its camera without the frame's pose, pixel, point.
struct oracle_row {
  uncertainty_view<scene_camera> view;  ///< T_cw: body to camera
  Eigen::VectorXd pixel;
  Eigen::Vector3d X;
  Eigen::Matrix3d Sigma;

  uncertainty_view<scene_camera> at(const oracle_frame& x) const {
    uncertainty_view<scene_camera> v = view;
    v.T_cw = view.T_cw * oracle_pose{x.R, x.t};
    return v;
  }
  double gate() const { return view.bf > 0 ? 7.815 : 5.991; }
};

/// What a pixel and its point are off by in sigmas, where the point is best for this pose: by Gauss and Newton on the three
/// numbers of its step, halved where it would not gain. Rays begin at `from`.
Eigen::VectorXd oracle_errors(const oracle_row& row, const oracle_frame& pose, const Eigen::Vector3d& from) {
  const auto view = row.at(pose);
  const Eigen::MatrixXd N = view.noise().llt().matrixL(), S = row.Sigma.llt().matrixL();
  const Eigen::Vector3d ray = row.X - from, u = ray.normalized();
  const auto errors = [&](const Eigen::Vector3d& step) {
    const Eigen::Vector3d across = ray + step - u * u.dot(step);
    const Eigen::Vector3d X = from + across / (1 - u.dot(step) / ray.norm());
    Eigen::VectorXd e(view.size() + 3);
    e.head(view.size()) = N.triangularView<Eigen::Lower>().solve(view(X) - row.pixel);
    e.tail(3) = S.triangularView<Eigen::Lower>().solve(step);
    return e;
  };
  Eigen::Vector3d step = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::MatrixXd J(view.size() + 3, 3);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d h = 1e-6 * Eigen::Vector3d::Unit(i);
      J.col(i) = (errors(step + h) - errors(step - h)) / 2e-6;
    }
    const Eigen::VectorXd e = errors(step);
    Eigen::Vector3d d = -(J.transpose() * J).ldlt().solve(J.transpose() * e);
    while (d.norm() > 1e-12 && !(errors(step + d).squaredNorm() <= e.squaredNorm())) d /= 2;
    step += d;
    if (d.norm() <= 1e-12) break;
  }
  return errors(step);
}

/// Rounds as motion_only's: every one from the first guess, outliers by the pose that it found.
oracle_frame adjust_by_oracle(const std::vector<oracle_row>& rows, const oracle_frame& guess,
                              std::vector<bool>& outlier) {
  outlier.assign(rows.size(), false);
  oracle_frame pose = guess;
  const Eigen::Vector3d from = -guess.R.transpose() * guess.t;
  for (int round = 0; round < 4; ++round) {
    oracle_problem o;
    o.frames.push_back(guess);
    o.frame_fixed = {false};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (outlier[i]) continue;
      const oracle_row& row = rows[i];
      oracle_block b;
      b.frame = 0;
      b.e = [&row, from](const oracle_frame& x, const oracle_frame&, const Eigen::Vector3d&) {
        return oracle_errors(row, x, from);
      };
      b.kernel = [&row, round](double chi2, double& rho, double& weight) {
        const double d = row.gate();
        rho = round < 3 && chi2 > d ? 2 * std::sqrt(d * chi2) - d : chi2;
        weight = round < 3 && chi2 > d ? std::sqrt(d / chi2) : 1;
      };
      o.blocks.push_back(b);
    }
    oracle_adjust(o, 30);
    pose = o.frames[0];
    for (std::size_t i = 0; i < rows.size(); ++i)
      outlier[i] = oracle_errors(rows[i], pose, from).squaredNorm() > rows[i].gate();
  }
  return pose;
}

TEST_CASE("poses and outliers are those of the oracle") {
  motion_only_options options;
  options.iterations = 40;
  options.point_steps = 12, options.point_sigmas = 1e9;  // to the end, as the oracle
  options.stereo_correlation = 0.6;
  for (const auto kind : {scene_kind::mono, scene_kind::stereo, scene_kind::fisheye_rig}) {
    CAPTURE(static_cast<int>(kind));
    const uncertain_frames u(kind, 3, 9);
    const auto& in = u.in;
    const posed p = u.adjust(sequential{}, options);
    for (std::size_t f = 0; f < 3; ++f) {
      std::vector<oracle_row> rows;
      const auto first = static_cast<std::size_t>(in.begin[f]), last = static_cast<std::size_t>(in.begin[f + 1]);
      for (std::size_t i = first; i < last; ++i) {
        const auto& c = in.s.rig[in.camera[i]];
        const bool right = c.bf > 0 && in.pixel[i].z >= 0;
        oracle_row row{{c.camera, to_oracle_pose(c.T_camera_body), right ? c.bf : 0, 1 / in.information[i],
                        options.stereo_correlation},
                       Eigen::VectorXd(right ? 3 : 2),
                       {in.point[i].x, in.point[i].y, in.point[i].z},
                       to_eigen(u.covariance[i])};
        row.pixel(0) = in.pixel[i].x, row.pixel(1) = in.pixel[i].y;
        if (right) row.pixel(2) = in.pixel[i].z;
        rows.push_back(row);
      }
      const oracle_pose T = to_oracle_pose(in.s.poses[f]);
      std::vector<bool> outlier;
      const oracle_frame found = adjust_by_oracle(rows, {T.R, T.t, Eigen::VectorXd(0)}, outlier);
      for (std::size_t i = first; i < last; ++i) CHECK((p.outlier[i] != 0) == outlier[i - first]);
      const auto got = turbomap::to_isometry<double>(p.frames[f].T_cw);
      CHECK((Eigen::Vector3d(got.t.x, got.t.y, got.t.z) - found.t).norm() < 1e-5);
      for (int i = 0; i < 9; ++i) CHECK(std::abs(got.R.m[i] - found.R(i / 3, i % 3)) < 1e-5);
    }
  }
}

}  // namespace
