// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
// Residuals between two inertial states: zero where prediction says, derivatives against dual numbers, whitening.

#include <doctest/doctest.h>

#include <cmath>

#include <turbomap/inertial/inertial_residual.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/math/dual.hpp>

#include "preintegration_cases.hpp"

namespace {

using namespace turbomap_test;
using turbomap::inertial_state;
using turbomap::isometry;

/// Two states some way off from what was measured, on any pose; the second bias has its own value.
struct inertial_case {
  preintegration<double> p;
  isometry<double> T_bc;
  inertial_state<double> i, j;
  vec3<double> gravity;
};

inertial_case make_case(unsigned seed, double off) {
  std::mt19937_64 random(seed);
  const imu_motion m = make_imu_motion(seed, 300, 1);
  inertial_case c;
  c.p = turbomap::preintegrate(m.samples(), m.intervals[0], m.biases[0], {});
  c.T_bc = {turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 0.2)};
  c.i.T_cw = turbomap::to_rigid_transform(
      isometry<double>{turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 5)});
  c.i.velocity = random_vector(random, 2);
  c.i.bias = {m.biases[0].gyro + random_vector(random, 0.05), m.biases[0].acceleration + random_vector(random, 0.3)};
  c.gravity = turbomap::rotation_exp(random_vector(random, 3)) * vec3<double>{0, 0, -9.81};
  c.j = turbomap::predict(c.i, c.p, c.gravity, c.T_bc);
  double step[15];
  std::uniform_real_distribution<double> u(-off, off);
  for (double& x : step) x = u(random);
  c.j = turbomap::move_state(step, c.j);
  return c;
}

TEST_CASE("what was predicted has no residual") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const inertial_case c = make_case(seed, 0);
    double r[9];
    turbomap::inertial_residual(c.p, c.T_bc, c.i, c.j, c.gravity, r);
    for (const double x : r) CHECK(std::abs(x) < 1e-12);
  }
}

TEST_CASE("derivatives are those of dual numbers") {
  using dual = turbomap::dual<32>;  // both states, direction of gravity
  for (const double off : {0.0, 0.1, 1.5})
    for (unsigned seed = 0; seed < 20; ++seed) {
      CAPTURE(seed);
      CAPTURE(off);
      const inertial_case c = make_case(seed, off);
      double r[9];
      turbomap::inertial_jacobian J;
      turbomap::linearise_inertial_residual(c.p, c.T_bc, c.i, c.j, c.gravity, r, J);

      dual step[32], expected[9];
      for (int k = 0; k < 32; ++k) step[k] = dual::variable(0, k);
      turbomap::inertial_residual(c.p, c.T_bc, turbomap::move_state(step, c.i), turbomap::move_state(step + 15, c.j),
                                  turbomap::turn_gravity(c.gravity, step + 30), expected);
      double worst = 0;
      for (int row = 0; row < 9; ++row) {
        worst = std::max(worst, std::abs(r[row] - expected[row].a));
        for (int k = 0; k < 32; ++k) {
          const double d = k < 15 ? J.i[15 * row + k] : k < 30 ? J.j[15 * row + k - 15] : J.gravity[2 * row + k - 30];
          worst = std::max(worst, std::abs(d - expected[row].d[k]) / (1 + std::abs(d)));
        }
      }
      CHECK(worst < 1e-11);
    }
}

TEST_CASE("a gravity that is turned keeps its length, about axes at right angles") {
  std::mt19937_64 random(9);
  for (int k = 0; k < 20; ++k) {
    vec3<double> g = random_vector(random, 9), basis[2];
    if (k < 3) g = k == 0 ? vec3<double>{9.81, 0, 0} : k == 1 ? vec3<double>{0, -9.81, 0} : vec3<double>{0, 0, -9.81};
    turbomap::gravity_basis(g, basis);
    CHECK(std::abs(turbomap::dot(basis[0], basis[1])) < 1e-15);
    CHECK(std::abs(turbomap::dot(basis[0], g)) < 1e-14);
    CHECK(turbomap::norm(basis[1]) == doctest::Approx(1).epsilon(1e-14));
    const double step[2] = {0.3, -0.4};
    const vec3<double> turned = turbomap::turn_gravity(g, step);
    CHECK(turbomap::norm(turned) == doctest::Approx(turbomap::norm(g)).epsilon(1e-14));
    CHECK(std::acos(turbomap::dot(turned, g) / turbomap::dot(g, g)) == doctest::Approx(0.5).epsilon(1e-12));
  }
}

TEST_CASE("whitened residuals have unit covariance; one step is not enough") {
  const imu_motion m = make_imu_motion(4, 300, 20);
  for (const auto& in : m.intervals) {
    const auto p = turbomap::preintegrate(m.samples(), in, m.biases[0], {});
    double W[81];
    const bool enough = in.last - in.first > 1;
    CHECK(turbomap::inertial_whitening(p, W) == enough);
    if (!enough) continue;
    const Eigen::Matrix<double, 9, 9> E = Eigen::Map<const Eigen::Matrix<double, 9, 9, Eigen::RowMajor>>(W);
    const Eigen::MatrixXd I = E * covariance_of(p).topLeftCorner(9, 9) * E.transpose();
    CHECK((I - Eigen::MatrixXd::Identity(9, 9)).norm() < 1e-8);
  }
  const auto one = turbomap::find_interval(m.samples(), m.t_ns[3], m.t_ns[4]);
  double W[81];
  CHECK_FALSE(turbomap::inertial_whitening(turbomap::preintegrate(m.samples(), one, m.biases[0], {}), W));
  preintegration_options exact;
  exact.noise.gyro = 0;
  CHECK_FALSE(turbomap::inertial_whitening(turbomap::preintegrate(m.samples(), m.intervals[0], m.biases[0], exact), W));
}

TEST_CASE("biases walk by their difference") {
  double r[6];
  turbomap::bias_walk_residual<double>({{1, 2, 3}, {4, 5, 6}}, {{1.5, 2, 2}, {4, 7, 6}}, r);
  CHECK(r[0] == 0.5);
  CHECK(r[2] == -1);
  CHECK(r[4] == 2);
}

}  // namespace
