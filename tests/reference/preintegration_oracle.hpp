// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Preintegration as the paper writes it [Forster et al., T-RO 2017, Sec. VI and appendix]: step by step, covariance by
/// dense matrices, in Eigen. It is given steps of constant measurements; how an interval is cut into them is
/// oracle_steps().

#include <turbomap/inertial/imu_samples.hpp>
#include <turbomap/inertial/preintegration_options.hpp>

#include <cstdint>
#include <vector>

#include "eigen.hpp"

namespace turbomap_test {

/// Angular velocity and specific force, constant for dt seconds.
struct oracle_step {
  double dt;
  Eigen::Vector3d w, a;
};

struct oracle_preintegration {
  double dt = 0;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d V = Eigen::Vector3d::Zero(), P = Eigen::Vector3d::Zero();
  Eigen::Matrix3d J_Rg, J_Vg, J_Va, J_Pg, J_Pa;
  Eigen::Matrix<double, 15, 15> C;

  oracle_preintegration() {
    for (Eigen::Matrix3d* J : {&J_Rg, &J_Vg, &J_Va, &J_Pg, &J_Pa}) J->setZero();
    C.setZero();
  }
};

inline Eigen::Matrix3d oracle_skew(const Eigen::Vector3d& w) {
  Eigen::Matrix3d W;
  W << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return W;
}
inline Eigen::Matrix3d oracle_exp(const Eigen::Vector3d& w) {
  const double t = w.norm();
  return t == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                : Eigen::AngleAxisd(t, Eigen::Vector3d(w / t)).toRotationMatrix();
}
/// The rotation vector; not near pi.
inline Eigen::Vector3d oracle_log(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd a(R);
  return a.angle() * a.axis();
}
/// Right Jacobian of SO(3), by its power series.
inline Eigen::Matrix3d oracle_right_jacobian(const Eigen::Vector3d& w) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Identity(), term = sum;
  const Eigen::Matrix3d W = oracle_skew(w);
  for (int k = 1; k < 30; ++k) term = Eigen::Matrix3d(term * W * (-1.0 / (k + 1))), sum += term;
  return sum;
}

/// Integrates steps at a bias.
inline oracle_preintegration oracle_integrate(const std::vector<oracle_step>& steps, const Eigen::Vector3d& gyro_bias,
                                              const Eigen::Vector3d& acceleration_bias,
                                              const turbomap::preintegration_options& options) {
  using Eigen::Matrix3d;
  const turbomap::imu_noise& noise = options.noise;
  const bool midpoint = options.rule == turbomap::integration_rule::midpoint;
  oracle_preintegration p;
  for (const oracle_step& s : steps) {
    const Eigen::Vector3d w = s.w - gyro_bias, a = s.a - acceleration_bias;
    const double dt = s.dt, seconds = noise.rate > 0 ? 1 / noise.rate : dt;
    const Matrix3d E = oracle_exp(w * dt), right = oracle_right_jacobian(w * dt), R = p.R;
    // The orientation of the force, and how the force turns with the angular velocity (by gyroscope: 0 at the
    // beginning).
    const Matrix3d M = midpoint ? Matrix3d(R * oracle_exp(w * dt / 2)) : R;
    Matrix3d by_w = Matrix3d::Zero();
    if (midpoint) by_w = -M * oracle_skew(a) * oracle_right_jacobian(w * dt / 2) * dt / 2;
    const Matrix3d by_R = -R * oracle_skew(R.transpose() * M * a);  // by an error of R on its right

    Eigen::Matrix<double, 9, 9> A;
    A.setIdentity();
    A.block<3, 3>(0, 0) = E.transpose();
    A.block<3, 3>(3, 0) = by_R * dt, A.block<3, 3>(6, 0) = 0.5 * by_R * dt * dt;
    A.block<3, 3>(6, 3) = Matrix3d::Identity() * dt;
    Eigen::Matrix<double, 9, 6> B;
    B.setZero();
    B.block<3, 3>(0, 0) = right * dt, B.block<3, 3>(3, 3) = M * dt, B.block<3, 3>(6, 3) = 0.5 * M * dt * dt;
    B.block<3, 3>(3, 0) = by_w * dt, B.block<3, 3>(6, 0) = 0.5 * by_w * dt * dt;
    Eigen::Matrix<double, 6, 1> variance;
    variance.head<3>().setConstant(noise.gyro * noise.gyro / seconds);
    variance.tail<3>().setConstant(noise.acceleration * noise.acceleration / seconds);
    p.C.topLeftCorner<9, 9>() =
        A * p.C.topLeftCorner<9, 9>().eval() * A.transpose() + B * variance.asDiagonal() * B.transpose();
    for (int i = 0; i < 3; ++i) {
      p.C(9 + i, 9 + i) += noise.gyro_walk * noise.gyro_walk * seconds;
      p.C(12 + i, 12 + i) += noise.acceleration_walk * noise.acceleration_walk * seconds;
    }

    // A bias is a constant error of the other sign: the same A and B.
    Eigen::Matrix<double, 9, 6> J;
    J << p.J_Rg, Matrix3d::Zero(), p.J_Vg, p.J_Va, p.J_Pg, p.J_Pa;
    J = (A * J - B).eval();
    p.J_Rg = J.block<3, 3>(0, 0), p.J_Vg = J.block<3, 3>(3, 0), p.J_Va = J.block<3, 3>(3, 3);
    p.J_Pg = J.block<3, 3>(6, 0), p.J_Pa = J.block<3, 3>(6, 3);
    p.P += p.V * dt + 0.5 * M * a * dt * dt;
    p.V += M * a * dt;
    p.R = (R * E).eval();
    p.dt += dt;
  }
  return p;
}

/// The steps of an interval: knots at its ends and at the samples between; mean of the values at both knots.
inline std::vector<oracle_step> oracle_steps(const std::vector<std::int64_t>& t_ns,
                                             const std::vector<turbomap::imu_sample>& sample,
                                             const turbomap::imu_interval& in) {
  using vector6 = Eigen::Matrix<double, 6, 1>;
  const auto value = [&](int i) {
    const auto& s = sample[static_cast<std::size_t>(i)];
    vector6 v;
    v << s.gyro.x, s.gyro.y, s.gyro.z, s.acceleration.x, s.acceleration.y, s.acceleration.z;
    return v;
  };
  const auto time = [&](int i) { return static_cast<double>(t_ns[static_cast<std::size_t>(i)] - in.begin_ns) * 1e-9; };
  const auto on_line = [&](int i, double t) {
    return vector6(value(i) + (value(i + 1) - value(i)) * ((t - time(i)) / (time(i + 1) - time(i))));
  };
  const double end = static_cast<double>(in.end_ns - in.begin_ns) * 1e-9;
  std::vector<double> t{0};
  std::vector<vector6> v{on_line(in.first, 0)};
  for (int i = in.first + 1; i < in.last; ++i) t.push_back(time(i)), v.push_back(value(i));
  t.push_back(end), v.push_back(on_line(in.last - 1, end));
  std::vector<oracle_step> steps;
  for (std::size_t k = 0; k + 1 < t.size(); ++k) {
    const vector6 mean = (v[k] + v[k + 1]) / 2;
    steps.push_back({t[k + 1] - t[k], mean.head<3>(), mean.tail<3>()});
  }
  return steps;
}

}  // namespace turbomap_test
