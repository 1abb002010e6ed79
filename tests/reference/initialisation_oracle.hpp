// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Inertial-only estimation as one dense problem in the notation of the paper: poses of the body in the world, all unknowns in
/// one vector, numerical derivatives, Gauss-Newton [Campos et al., ICRA 2020]. The weights are those at a given estimate.

#include <cmath>
#include <functional>
#include <vector>

#include "preintegration_oracle.hpp"

namespace turbomap_test {

struct oracle_estimate {
  Eigen::Vector3d gyro, acceleration, gravity;  ///< biases; gravity in the world
  double scale = 1;
  std::vector<Eigen::Vector3d> velocity;
};

/// What is estimated, and from what.
struct oracle_initialisation {
  std::vector<Eigen::Matrix3d> R_cw;
  std::vector<Eigen::Vector3d> t_cw;  ///< in the unit of the map
  Eigen::Matrix3d R_bc;
  Eigen::Vector3d t_bc;
  std::vector<oracle_preintegration> motion;
  std::vector<Eigen::Vector3d> motion_gyro, motion_acceleration;  ///< biases of the integration
  bool monocular = false;
  double rotation_sigma, position_sigma, gyro_sigma, acceleration_sigma;
  double scale_sigma = 10;                  ///< of its logarithm
  double gyro_spread, acceleration_spread;  ///< of the biases around their mean, standard deviations

  /// Rotation (rad), velocity (m/s), position (in the unit of the map), the poses moved by `off` (6 per keyframe: a turn of the
  /// camera, then a shift of the point that it maps to).
  Eigen::Matrix<double, 9, 1> residual(std::size_t k, const oracle_estimate& x,
                                       const Eigen::Matrix<double, 12, 1>& off) const {
    Eigen::Matrix3d R[2];
    Eigen::Vector3d p[2];
    for (std::size_t s = 0; s < 2; ++s) {
      const auto at = static_cast<Eigen::Index>(6 * s);
      const Eigen::Matrix3d turn = oracle_exp(off.segment<3>(at));
      const Eigen::Matrix3d R_cw_moved = turn * R_cw[k + s];
      const Eigen::Vector3d t = x.scale * (turn * t_cw[k + s] + off.segment<3>(at + 3));
      R[s] = (R_bc * R_cw_moved).transpose(), p[s] = -R[s] * (R_bc * t + t_bc);
    }
    const auto& m = motion[k];
    const Eigen::Vector3d dg = x.gyro - motion_gyro[k], da = x.acceleration - motion_acceleration[k];
    Eigen::Matrix<double, 9, 1> r;
    const Eigen::Matrix3d dR = m.R * oracle_exp(m.J_Rg * dg);
    r.head<3>() = oracle_log(dR.transpose() * R[0].transpose() * R[1]);
    r.segment<3>(3) =
        R[0].transpose() * (x.velocity[k + 1] - x.velocity[k] - m.dt * x.gravity) - m.V - m.J_Vg * dg - m.J_Va * da;
    r.tail<3>() = (R[0].transpose() * (p[1] - p[0] - m.dt * x.velocity[k] - 0.5 * m.dt * m.dt * x.gravity) - m.P -
                   m.J_Pg * dg - m.J_Pa * da) /
                  x.scale;
    return r;
  }

  /// The estimate from `x` on, with the weights at `weights_at`.
  oracle_estimate solve(oracle_estimate x, const oracle_estimate& weights_at) const {
    using vector = Eigen::VectorXd;
    const Eigen::Index n = static_cast<Eigen::Index>(x.velocity.size());
    std::vector<Eigen::MatrixXd> W;
    for (std::size_t k = 0; k < motion.size(); ++k) {
      Eigen::Matrix<double, 9, 12> J;
      for (int c = 0; c < 12; ++c) {
        Eigen::Matrix<double, 12, 1> h = Eigen::Matrix<double, 12, 1>::Zero();
        h[c] = 1e-6;
        J.col(c) = (residual(k, weights_at, h) - residual(k, weights_at, -h)) / 2e-6;
        J.col(c) *= c % 6 < 3 ? rotation_sigma : position_sigma;
      }
      Eigen::Matrix<double, 9, 9> C = motion[k].C.topLeftCorner<9, 9>();
      C.bottomRows<3>() /= weights_at.scale, C.rightCols<3>() /= weights_at.scale;
      C += J * J.transpose();
      for (int c = 0; c < 6; ++c) {
        const Eigen::Vector3d h = 1e-4 * Eigen::Vector3d::Unit(c % 3);
        oracle_estimate more = weights_at, less = weights_at;
        (c < 3 ? more.gyro : more.acceleration) += h, (c < 3 ? less.gyro : less.acceleration) -= h;
        const Eigen::Matrix<double, 12, 1> still = Eigen::Matrix<double, 12, 1>::Zero();
        const Eigen::Matrix<double, 9, 1> d = (residual(k, more, still) - residual(k, less, still)) / 2e-4;
        C += std::pow(c < 3 ? gyro_spread : acceleration_spread, 2) * d * d.transpose();
      }
      W.push_back(C.llt().matrixL().solve(Eigen::MatrixXd::Identity(9, 9)));
    }
    const Eigen::Index unknowns = 9 + 3 * n;  // biases, turns of gravity, log-scale, velocities
    const auto moved = [&](const oracle_estimate& from, const vector& d) {
      oracle_estimate to = from;
      to.gyro += d.segment<3>(0), to.acceleration += d.segment<3>(3);
      const Eigen::Vector3d a = from.gravity.unitOrthogonal(), b = from.gravity.normalized().cross(a);
      to.gravity = oracle_exp(d[6] * a + d[7] * b) * from.gravity;
      if (monocular) to.scale *= std::exp(d[8]);
      for (Eigen::Index k = 0; k < n; ++k) to.velocity[static_cast<std::size_t>(k)] += d.segment<3>(9 + 3 * k);
      return to;
    };
    const auto all = [&](const oracle_estimate& at) {
      vector e(9 * (n - 1) + 7);
      for (Eigen::Index k = 0; k + 1 < n; ++k) {
        const auto i = static_cast<std::size_t>(k);
        e.segment<9>(9 * k) = W[i] * residual(i, at, Eigen::Matrix<double, 12, 1>::Zero());
      }
      e.tail<7>() << at.gyro / gyro_sigma, at.acceleration / acceleration_sigma, std::log(at.scale) / scale_sigma;
      return e;
    };
    for (int round = 0; round < 12; ++round) {
      const vector e = all(x);
      Eigen::MatrixXd J(e.size(), unknowns);
      for (Eigen::Index c = 0; c < unknowns; ++c) {
        const double h = 1e-6;
        J.col(c) =
            (all(moved(x, h * vector::Unit(unknowns, c))) - all(moved(x, -h * vector::Unit(unknowns, c)))) / (2 * h);
      }
      if (!monocular) J(e.size() - 1, 8) = 1;  // held
      x = moved(x, -J.colPivHouseholderQr().solve(e));
    }
    return x;
  }
};

}  // namespace turbomap_test
