// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small visual-inertial problem, as the library takes it and for the oracle, with formulas of its own.

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/inertial/inertial_factors.hpp>
#include <turbomap/inertial/inertial_frame.hpp>
#include <turbomap/inertial/predict.hpp>

#include "preintegration_cases.hpp"
#include "reference/adjustment_oracle.hpp"

namespace turbomap_test {

using turbomap::bias_walk_factor;
using turbomap::inertial_factor;
using turbomap::inertial_frame;
using turbomap::inertial_prior_factor;
using turbomap::inertial_state;
using turbomap::isometry;
using inertial_camera = turbomap::pinhole<double>;

/// What the problem of a scene is made of.
template <class Policy, class Factor = inertial_factor>
using inertial_problem = turbomap::bundle_problem<
    Policy, inertial_frame, turbomap::reprojections<inertial_camera>, turbomap::frame_pair_factors<Factor>,
    turbomap::frame_pair_factors<Factor, turbomap::huber>, turbomap::frame_pair_factors<bias_walk_factor>,
    turbomap::frame_factors<inertial_prior_factor>>;

/// Keyframes every 0.25 s on a lively motion. The first inertial edge is robust and down-weighted.
struct inertial_scene {
  std::vector<turbomap::rig_camera<inertial_camera>> rig{{{435, 436, 367, 252}, {}, 47.9, {}}};
  isometry<double> T_bc;
  vec3<double> gravity{0, 0, -9.81};
  std::vector<inertial_state<double>> truth, states;
  std::vector<std::uint8_t> fixed;
  std::vector<std::uint32_t> held;
  std::vector<vec3<double>> true_points, points;
  std::vector<std::int32_t> frame, landmark;
  std::vector<vec3<double>> pixel;
  std::vector<double> information;
  std::vector<std::int32_t> first, second;  ///< of inertial edges; the first one is the robust one
  std::vector<inertial_factor::row> edges;
  std::vector<bias_walk_factor::row> walks;
  std::vector<std::int32_t> prior_frame;
  std::vector<inertial_prior_factor::row> priors;

  /// \param factor  of the preintegrations, e.g. one whose derivatives are dual numbers
  template <class Policy, class Factor>
  void assign(turbomap::context<Policy>& ctx, inertial_problem<Policy, Factor>& problem, Factor factor) const {
    using turbomap::span;
    using indices = span<const std::int32_t>;
    using rows = span<const inertial_factor::row>;
    turbomap::reprojections<inertial_camera> seen =
        turbomap::huber_reprojections(turbomap::rig_view<inertial_camera>{rig.data(), 1});
    seen.frame = frame, seen.landmark = landmark, seen.pixel = pixel, seen.information = information;
    const std::size_t n = edges.size(), robust = n > 0 ? 1 : 0;
    factor.T_bc = T_bc, factor.gravity = gravity;
    problem.assign(ctx, {states, fixed, held}, {points, {}}, seen,
                   {factor,
                    indices{first.data() + robust, n - robust},
                    indices{second.data() + robust, n - robust},
                    rows{edges.data() + robust, n - robust},
                    {},
                    1e6},
                   {factor, indices{first.data(), robust}, indices{second.data(), robust}, rows{edges.data(), robust},
                    turbomap::huber{16.92}, 1e6},
                   {{}, first, second, walks, {}, 1e6}, {{}, prior_frame, priors, {}, 1e6});
  }
};

inline inertial_scene make_inertial_scene(int frames, int points_per_frame, unsigned seed) {
  using turbomap::operator*;
  using turbomap::operator+;
  inertial_scene s;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const imu_motion m = make_imu_motion(seed, 60 * frames, 0);
  const imu_bias<double> bias{random_vector(random, 0.02), random_vector(random, 0.1)};
  s.T_bc = {turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 0.1)};
  inertial_state<double> x;
  x.T_cw = turbomap::to_rigid_transform(
      isometry<double>{turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 1)});
  x.velocity = random_vector(random, 1), x.bias = bias;
  for (int f = 0; f < frames; ++f) {
    s.truth.push_back(x);
    if (f + 1 == frames) break;
    const std::int64_t begin = m.t_ns[3] + f * 250'000'000LL;
    const auto interval = turbomap::find_interval(m.samples(), begin, begin + 250'000'000LL);
    // Integrated where the bias was believed to be: corrected to first order.
    const imu_bias<double> believed{bias.gyro + random_vector(random, 1e-3), bias.acceleration};
    const auto exact = turbomap::preintegrate(m.samples(), interval, bias, {});
    inertial_factor::row edge;
    turbomap::make_inertial_row(turbomap::preintegrate(m.samples(), interval, believed, {}), f == 0 ? 1e-2 : 1, edge);
    bias_walk_factor::row walk;
    turbomap::make_walk_row(exact, walk);
    s.first.push_back(f), s.second.push_back(f + 1), s.edges.push_back(edge), s.walks.push_back(walk);
    x = turbomap::predict(x, exact, s.gravity, s.T_bc);
  }
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int f = 0; f < frames; ++f)
    for (int i = 0; i < points_per_frame; ++i) {
      const double z = 5 + 2 * uniform(random), px = 300 * uniform(random), py = 200 * uniform(random);
      const vec3<double> in_camera{z * px / 435, z * py / 436, z};
      s.true_points.push_back(
          turbomap::inverse(turbomap::to_isometry<double>(s.truth[static_cast<std::size_t>(f)].T_cw)) * in_camera);
      s.points.push_back(s.true_points.back() +
                         vec3<double>{0.03 * normal(random), 0.03 * normal(random), 0.03 * normal(random)});
    }
  for (int f = 0; f < frames; ++f)
    for (std::size_t l = 0; l < s.points.size(); ++l) {
      const auto p = turbomap::to_isometry<double>(s.truth[static_cast<std::size_t>(f)].T_cw) * s.true_points[l];
      const double u = 435 * p.x / p.z + 367, v = 436 * p.y / p.z + 252;
      if (p.z < 1 || std::abs(u - 367) > 400 || std::abs(v - 252) > 300) continue;
      const bool stereo = (l + static_cast<std::size_t>(f)) % 3 != 0;
      s.frame.push_back(f), s.landmark.push_back(static_cast<std::int32_t>(l));
      s.pixel.push_back(
          {u + 0.5 * normal(random), v + 0.5 * normal(random), stereo ? u - 47.9 / p.z + 0.5 * normal(random) : -1});
      s.information.push_back(4);
    }
  for (int f = 0; f < frames; ++f) {
    double step[15];
    for (int i = 0; i < 15; ++i) step[i] = (i < 6 ? 0.01 : i < 9 ? 0.05 : i < 12 ? 1e-3 : 0.02) * normal(random);
    const auto& T = s.truth[static_cast<std::size_t>(f)];
    s.fixed.push_back(f == 0 ? 1 : 0);
    s.states.push_back(f == 0 ? T : turbomap::move_state(step, T));
  }
  s.prior_frame = {frames - 1};
  s.priors.push_back({x.velocity, x.bias, 1, 100, 10});
  return s;
}

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
