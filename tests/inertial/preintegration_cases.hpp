// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random motions of an IMU, and what must hold of their preintegrations under every policy.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/inertial/preintegrate.hpp>

#include "reference/preintegration_oracle.hpp"

namespace turbomap_test {

using turbomap::imu_bias;
using turbomap::imu_interval;
using turbomap::imu_sample;
using turbomap::preintegration;
using turbomap::preintegration_options;
using turbomap::span;
using turbomap::vec3;

/// Samples of a lively motion with irregular times, and intervals in it.
struct imu_motion {
  std::vector<std::int64_t> t_ns;
  std::vector<imu_sample> sample;
  std::vector<imu_interval> intervals;
  std::vector<imu_bias<double>> biases;

  turbomap::imu_samples samples() const { return {t_ns, sample}; }
};

inline vec3<double> random_vector(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> u(-size, size);
  const double x = u(random), y = u(random);
  return {x, y, u(random)};
}

/// \param seconds  up to this the intervals last
inline imu_motion make_imu_motion(unsigned seed, int samples, int intervals, double seconds = 1) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> u(0, 1);
  imu_motion m;
  std::int64_t t = 1'600'000'000'000'000'000;
  const vec3<double> f = random_vector(random, 3), g = random_vector(random, 2);
  for (int i = 0; i < samples; ++i) {
    m.t_ns.push_back(t);
    const double s = static_cast<double>(t - m.t_ns[0]) * 1e-9;
    const vec3<double> noise = random_vector(random, 0.02), more = random_vector(random, 0.2);
    m.sample.push_back({{2 * std::sin(f.x * s) + noise.x, 1.5 * std::cos(f.y * s) + noise.y, f.z + noise.z},
                        {4 * std::sin(g.x * s + 1) + more.x, 3 * std::cos(g.y * s) + more.y, 9.81 + g.z + more.z}});
    t += 4'000'000 + static_cast<std::int64_t>(2'000'000 * u(random));
  }
  const double length = static_cast<double>(m.t_ns.back() - m.t_ns.front());
  for (int i = 0; i < intervals; ++i) {
    const double last = std::min(length, 1e9 * seconds);
    const double duration = 1e6 + (last - 1e6) * u(random), begin = (length - duration) * u(random);
    const auto from = m.t_ns[0] + static_cast<std::int64_t>(begin);
    m.intervals.push_back(turbomap::find_interval(m.samples(), from, from + static_cast<std::int64_t>(duration)));
    m.biases.push_back({random_vector(random, 0.05), random_vector(random, 0.3)});
  }
  return m;
}

template <class S>
std::vector<imu_bias<S>> biases_in(const imu_motion& m) {
  std::vector<imu_bias<S>> b;
  for (const auto& x : m.biases) b.push_back({turbomap::cast<S>(x.gyro), turbomap::cast<S>(x.acceleration)});
  return b;
}

template <class S, class Policy>
std::vector<preintegration<S>> preintegrate_all(const Policy& policy, const imu_motion& m,
                                                const preintegration_options& options = {}) {
  turbomap::context<Policy> ctx{policy};
  turbomap::preintegrations<S, Policy> result(ctx);
  const auto biases = biases_in<S>(m);
  turbomap::preintegrate(ctx, m.samples(), span<const imu_interval>(m.intervals), span<const imu_bias<S>>(biases),
                         options, result);
  return result.values(ctx);
}

template <class S>
Eigen::Matrix3d to_eigen(const turbomap::mat3<S>& A) {
  Eigen::Matrix3d E;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) E(r, c) = static_cast<double>(A(r, c));
  return E;
}
template <class S>
Eigen::Vector3d to_eigen(const vec3<S>& a) {
  return {static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)};
}
template <class S>
Eigen::MatrixXd covariance_of(const preintegration<S>& p) {
  Eigen::MatrixXd C(15, 15);
  for (int r = 0; r < 15; ++r)
    for (int c = 0; c < 15; ++c) C(r, c) = static_cast<double>(p.covariance(r, c));
  return C;
}
/// Largest difference of two covariances, relative to the standard deviations of row and column.
inline double covariance_difference(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  const Eigen::VectorXd s = B.diagonal().cwiseSqrt().cwiseInverse();
  return (s.asDiagonal() * (A - B) * s.asDiagonal()).cwiseAbs().maxCoeff();
}

/// Largest relative difference of any part.
template <class S>
double difference(const preintegration<S>& p, const oracle_preintegration& o) {
  const auto relative = [](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
    return (a - b).norm() / std::max(b.norm(), 1e-9);
  };
  return std::max({std::abs(static_cast<double>(p.dt) - o.dt) / o.dt, relative(to_eigen(p.dR), o.R),
                   relative(to_eigen(p.dV), o.V), relative(to_eigen(p.dP), o.P), relative(to_eigen(p.J_Rg), o.J_Rg),
                   relative(to_eigen(p.J_Vg), o.J_Vg), relative(to_eigen(p.J_Va), o.J_Va),
                   relative(to_eigen(p.J_Pg), o.J_Pg), relative(to_eigen(p.J_Pa), o.J_Pa),
                   covariance_difference(covariance_of(p), o.C)});
}

inline oracle_preintegration oracle_of(const imu_motion& m, const imu_interval& in, const imu_bias<double>& bias,
                                       const preintegration_options& options = {}) {
  return oracle_integrate(oracle_steps(m.t_ns, m.sample, in), to_eigen(bias.gyro), to_eigen(bias.acceleration),
                          options);
}

/// Every interval is what the oracle makes of it.
template <class S, class Policy>
void check_against_oracle(const Policy& policy, [[maybe_unused]] double tolerance) {
  using turbomap::integration_rule;
  for (const auto rule : {integration_rule::midpoint, integration_rule::first_order}) {
    CAPTURE(static_cast<int>(rule));
    preintegration_options options;
    options.rule = rule;
    options.noise.rate = rule == integration_rule::midpoint ? 0 : 200;
    const imu_motion m = make_imu_motion(7, 800, 60);
    const auto got = preintegrate_all<S>(policy, m, options);
    REQUIRE(got.size() == m.intervals.size());
    for (std::size_t i = 0; i < got.size(); ++i) {
      CAPTURE(i);
      CHECK(difference(got[i], oracle_of(m, m.intervals[i], m.biases[i], options)) < tolerance);
    }
  }
}

/// One object, calls of several sizes, also none; the device memory view has the size of the call.
template <class Policy>
void check_sizes(const Policy& policy) {
  turbomap::context<Policy> ctx{policy};
  turbomap::preintegrations<double, Policy> result(ctx);
  for (const int n : {3, 50, 0, 7}) {
    CAPTURE(n);
    const imu_motion m = make_imu_motion(static_cast<unsigned>(n), 300, n);
    turbomap::preintegrate(ctx, m.samples(), span<const imu_interval>(m.intervals),
                           span<const imu_bias<double>>(m.biases), {}, result);
    const auto got = result.values(ctx);
    REQUIRE(got.size() == static_cast<std::size_t>(n));
    CHECK(result.resident().size() == got.size());
    for (std::size_t i = 0; i < got.size(); ++i)
      CHECK(difference(got[i], oracle_of(m, m.intervals[i], m.biases[i])) < 1e-11);
  }
}

}  // namespace turbomap_test
