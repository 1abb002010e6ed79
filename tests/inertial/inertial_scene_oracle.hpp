// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The scene of inertial_scene.hpp as a problem of the oracle, with formulas of its own.

#include <algorithm>
#include <cmath>
#include <vector>

#include "inertial_scene.hpp"
#include "reference/adjustment_oracle.hpp"

namespace turbomap_test {

inline oracle_frame frame_of(const inertial_state<double>& x, bool visual_only = false) {
  const auto& T = x.T_cw;
  oracle_frame f{Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).normalized().toRotationMatrix(), {T.tx, T.ty, T.tz}, {}};
  if (visual_only) return f;
  f.more.resize(9);
  f.more << to_eigen(x.velocity), to_eigen(x.bias.gyro), to_eigen(x.bias.acceleration);
  return f;
}

/// The nine residuals in the notation of the paper: poses of the body in the world.
inline Eigen::VectorXd oracle_inertial_residual(const inertial_scene& s, const preintegration<double>& p,
                                                const oracle_frame& i, const oracle_frame& j) {
  const Eigen::Matrix3d R_bc = to_eigen(s.T_bc.R);
  const Eigen::Vector3d t_bc = to_eigen(s.T_bc.t), g = to_eigen(s.gravity);
  const auto body = [&](const oracle_frame& f, Eigen::Matrix3d& R, Eigen::Vector3d& at) {
    R = (R_bc * f.R).transpose(), at = -R * (R_bc * f.t + t_bc);
  };
  Eigen::Matrix3d R_i, R_j;
  Eigen::Vector3d p_i, p_j;
  body(i, R_i, p_i), body(j, R_j, p_j);
  const Eigen::Vector3d v_i = i.more.head<3>(), v_j = j.more.head<3>();
  const Eigen::Vector3d dg = i.more.segment<3>(3) - to_eigen(p.bias.gyro);
  const Eigen::Vector3d da = i.more.tail<3>() - to_eigen(p.bias.acceleration);
  const Eigen::Vector3d turned = to_eigen(p.J_Rg) * dg;
  const Eigen::Matrix3d dR =
      to_eigen(p.dR) * (turned.norm() > 0 ? Eigen::AngleAxisd(turned.norm(), turned.normalized()).toRotationMatrix()
                                          : Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  const Eigen::AngleAxisd off(Eigen::Matrix3d(dR.transpose() * R_i.transpose() * R_j));
  Eigen::VectorXd r(9);
  r.head<3>() = off.angle() * off.axis();
  r.segment<3>(3) =
      R_i.transpose() * (v_j - v_i - p.dt * g) - to_eigen(p.dV) - to_eigen(p.J_Vg) * dg - to_eigen(p.J_Va) * da;
  r.tail<3>() = R_i.transpose() * (p_j - p_i - p.dt * v_i - 0.5 * p.dt * p.dt * g) - to_eigen(p.dP) -
                to_eigen(p.J_Pg) * dg - to_eigen(p.J_Pa) * da;
  return r;
}

inline oracle_problem oracle_of(const inertial_scene& s) {
  oracle_problem o;
  const auto plain = [](double chi2, double& rho, double& weight) { rho = chi2, weight = 1; };
  const auto huber_at = [](double delta2) {
    return [=](double chi2, double& rho, double& weight) {
      weight = chi2 <= delta2 ? 1 : std::sqrt(delta2 / chi2);
      rho = chi2 <= delta2 ? chi2 : 2 * std::sqrt(delta2 * chi2) - delta2;
    };
  };
  for (std::size_t f = 0; f < s.states.size(); ++f) {
    o.frames.push_back(frame_of(s.states[f]));
    o.frame_fixed.push_back(s.fixed[f] != 0);
  }
  o.held.assign(s.held.begin(), s.held.end());
  for (const auto& p : s.points) o.landmarks.push_back(to_eigen(p));
  o.landmark_fixed.assign(s.points.size(), false);
  for (std::size_t i = 0; i < s.frame.size(); ++i) {
    oracle_block b;
    b.frame = s.frame[i], b.landmark = s.landmark[i];
    const auto z = s.pixel[i];
    const double sigma = std::sqrt(s.information[i]);
    b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d& X) {
      const Eigen::Vector3d p = f.R * X + f.t;
      Eigen::VectorXd e(z.z >= 0 ? 3 : 2);
      const double u = 435 * p.x() / p.z() + 367;
      e[0] = u - z.x, e[1] = 436 * p.y() / p.z() + 252 - z.y;
      if (z.z >= 0) e[2] = u - 47.9 / p.z() - z.z;
      return Eigen::VectorXd(sigma * e);
    };
    b.kernel = huber_at(z.z >= 0 ? 7.815 : 5.991);
    o.blocks.push_back(b);
  }
  for (std::size_t k = 0; k < s.edges.size(); ++k) {
    oracle_block b;
    b.frame = s.first[k], b.other = s.second[k];
    const preintegration<double> p = s.edges[k].motion;
    const Eigen::MatrixXd C = covariance_of(p).topLeftCorner(9, 9);
    const Eigen::MatrixXd W = C.llt().matrixL().solve(Eigen::MatrixXd::Identity(9, 9)) * (k == 0 ? 0.1 : 1);
    b.e = [=, &s](const oracle_frame& i, const oracle_frame& j, const Eigen::Vector3d&) {
      return Eigen::VectorXd(W * oracle_inertial_residual(s, p, i, j));
    };
    b.kernel = k == 0 ? decltype(b.kernel)(huber_at(16.92)) : decltype(b.kernel)(plain);
    o.blocks.push_back(b);
    Eigen::VectorXd w(6);
    w << Eigen::Vector3d::Constant(1 / std::sqrt(p.gyro_walk)),
        Eigen::Vector3d::Constant(1 / std::sqrt(p.acceleration_walk));
    b.e = [=](const oracle_frame& i, const oracle_frame& j, const Eigen::Vector3d&) {
      return Eigen::VectorXd(w.cwiseProduct(j.more.tail<6>() - i.more.tail<6>()));
    };
    b.kernel = plain;
    o.blocks.push_back(b);
  }
  for (std::size_t k = 0; k < s.priors.size(); ++k) {
    oracle_block b;
    b.frame = s.prior_frame[k], b.kernel = plain;
    const auto& r = s.priors[k];
    Eigen::VectorXd known(9), w(9);
    known << to_eigen(r.velocity), to_eigen(r.bias.gyro), to_eigen(r.bias.acceleration);
    w << Eigen::Vector3d::Constant(r.velocity_weight), Eigen::Vector3d::Constant(r.gyro_weight),
        Eigen::Vector3d::Constant(r.acceleration_weight);
    b.e = [=](const oracle_frame& f, const oracle_frame&, const Eigen::Vector3d&) {
      return Eigen::VectorXd(w.cwiseProduct(f.more - known));
    };
    o.blocks.push_back(b);
  }
  return o;
}

/// Largest difference of states and landmarks.
inline double distance(const std::vector<inertial_state<double>>& states, const std::vector<vec3<double>>& points,
                       const oracle_problem& o) {
  double d = 0;
  for (std::size_t f = 0; f < states.size(); ++f) {
    const oracle_frame x = frame_of(states[f]);
    d = std::max({d, (x.R - o.frames[f].R).cwiseAbs().maxCoeff(), (x.t - o.frames[f].t).cwiseAbs().maxCoeff(),
                  (x.more - o.frames[f].more).cwiseAbs().maxCoeff()});
  }
  for (std::size_t l = 0; l < points.size(); ++l)
    d = std::max(d, (to_eigen(points[l]) - o.landmarks[l]).cwiseAbs().maxCoeff());
  return d;
}

}  // namespace turbomap_test
