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
TEST_CASE_TEMPLATE("covariances of zero say what none says", Policy, TURBOMAP_TEST_POLICIES) {
  check_exact_covariances(Policy{});
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

/// Rounds as motion_only's: every one from the first guess, weights at the pose before it, outliers by those at the pose found.
oracle_frame adjust_by_oracle(const std::vector<oracle_row>& rows, const oracle_frame& guess,
                              std::vector<bool>& outlier) {
  outlier.assign(rows.size(), false);
  oracle_frame pose = guess;
  for (int round = 0; round < 4; ++round) {
    oracle_problem o;
    o.frames.push_back(guess);
    o.frame_fixed = {false};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (outlier[i]) continue;
      const oracle_row& row = rows[i];
      const Eigen::MatrixXd L = oracle_spread(row.at(pose), row.X, row.Sigma).llt().matrixL();
      oracle_block b;
      b.frame = 0;
      b.e = [&row, L](const oracle_frame& x, const oracle_frame&, const Eigen::Vector3d&) {
        return Eigen::VectorXd(L.triangularView<Eigen::Lower>().solve(row.at(x)(row.X) - row.pixel));
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
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto v = rows[i].at(pose);
      const Eigen::VectorXd e = v(rows[i].X) - rows[i].pixel;
      outlier[i] = e.dot(oracle_spread(v, rows[i].X, rows[i].Sigma).inverse() * e) > rows[i].gate();
    }
  }
  return pose;
}

TEST_CASE("poses and outliers are those of the oracle") {
  motion_only_options options;
  options.iterations = 40;
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
