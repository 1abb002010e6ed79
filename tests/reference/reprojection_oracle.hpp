// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reprojections as blocks of the oracle of bundle adjustment, and a pose from points that are held fixed by that oracle:
/// rounds that each tell outliers anew.

#include <cmath>
#include <cstddef>
#include <vector>

#include "adjustment_oracle.hpp"
#include "eigen.hpp"
TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/Geometry>
TURBOMAP_TEST_EIGEN_END
#include "reprojection_cost.hpp"

namespace turbomap_test {

inline oracle_frame frame_of(const turbomap::rigid_transform<double>& T) {
  const Eigen::Quaterniond q(T.qw, T.qx, T.qy, T.qz);
  return {q.normalized().toRotationMatrix(), {T.tx, T.ty, T.tz}, Eigen::VectorXd(0)};
}

inline void huber_of(double delta2, double chi2, double& rho, double& weight) {
  rho = huber_rho(chi2, delta2);
  weight = chi2 <= delta2 ? 1 : std::sqrt(delta2 / chi2);
}

/// chi2 beyond which an observation is an outlier, and Huber's delta^2: 95 % of three and of two degrees of freedom.
inline double gate_of(bool stereo) { return stereo ? 7.815 : 5.991; }

/// The point in the camera's axes.
inline Eigen::Vector3d in_camera(const cost_camera& c, const oracle_frame& frame, const Eigen::Vector3d& X) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(c.R);
  return R * (frame.R * X + frame.t) + Eigen::Map<const Eigen::Vector3d>(c.t);
}

/// What one camera saw of one point; u_right counts where `stereo`.
struct oracle_sight {
  turbomap::vec3<double> pixel;
  double information;
  bool stereo;
};

/// Residuals in units of their standard deviation, with the Huber kernel of its gate.
inline oracle_block reprojection_block(int frame, int landmark, const cost_camera& camera, const oracle_sight& seen) {
  oracle_block b;
  b.frame = frame, b.landmark = landmark;
  b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d& X) {
    const Eigen::Vector3d p = in_camera(camera, f, X);
    const double x[3] = {p.x(), p.y(), p.z()};
    double u, v;
    camera.project(x, u, v);
    Eigen::VectorXd e(seen.stereo ? 3 : 2);
    e[0] = u - seen.pixel.x, e[1] = v - seen.pixel.y;
    if (seen.stereo) e[2] = u - camera.bf / p.z() - seen.pixel.z;
    return Eigen::VectorXd(std::sqrt(seen.information) * e);
  };
  b.kernel = [delta2 = gate_of(seen.stereo)](double chi2, double& rho, double& weight) {
    huber_of(delta2, chi2, rho, weight);
  };
  return b;
}

/// A pose, and by how much each observation is beyond its gate: chi2 / gate, infinite behind a straight camera.
struct adjusted_pose {
  oracle_frame frame;
  std::vector<double> excess;
  bool adjusted = true;
};

/// Observations of one frame, with the point and the camera of each.
struct oracle_sights {
  std::vector<oracle_sight> seen;
  std::vector<Eigen::Vector3d> point;
  std::vector<std::size_t> camera;

  void add(const turbomap::vec3<double>& X, const turbomap::vec3<double>& pixel, double information, std::size_t c,
           bool stereo) {
    seen.push_back({pixel, information, stereo}), point.emplace_back(X.x, X.y, X.z), camera.push_back(c);
  }
};

/// Four rounds of ten iterations from the same guess on the inliers of the round before, the last round without Huber's kernel. With
/// fewer than three inliers the guess stays.
inline adjusted_pose motion_only_oracle(const oracle_frame& guess, const std::vector<cost_camera>& rig,
                                        const oracle_sights& in) {
  adjusted_pose result{guess, std::vector<double>(in.seen.size(), 0)};
  for (int round = 0; round < 4; ++round) {
    oracle_problem p;
    p.frames = {guess}, p.frame_fixed = {false};
    for (std::size_t i = 0; i < in.seen.size(); ++i) {
      if (result.excess[i] > 1) continue;
      auto block = reprojection_block(0, static_cast<int>(p.landmarks.size()), rig[in.camera[i]], in.seen[i]);
      if (round == 3) block.kernel = [](double chi2, double& rho, double& weight) { rho = chi2, weight = 1; };
      p.landmarks.push_back(in.point[i]), p.landmark_fixed.push_back(true);
      p.blocks.push_back(block);
    }
    if (p.blocks.size() < 3) return {guess, std::vector<double>(in.seen.size(), HUGE_VAL), false};
    oracle_adjust(p, 10);
    result.frame = p.frames[0];
    for (std::size_t i = 0; i < in.seen.size(); ++i) {
      const auto& camera = rig[in.camera[i]];
      const auto block = reprojection_block(0, 0, camera, in.seen[i]);
      const bool behind = !camera.fisheye && !(in_camera(camera, result.frame, in.point[i]).z() > 0);
      const double chi2 = block.e(result.frame, {}, in.point[i]).squaredNorm();
      result.excess[i] = behind ? HUGE_VAL : chi2 / gate_of(in.seen[i].stereo);
    }
  }
  return result;
}

}  // namespace turbomap_test
