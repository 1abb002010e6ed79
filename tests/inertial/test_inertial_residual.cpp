// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Residuals between two inertial states: zero where prediction says, derivatives against dual numbers, whitening.

#include <cmath>

#include "inertial_residual_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("what was predicted has no residual", Policy, TURBOMAP_TEST_POLICIES) { check_predicted(Policy{}); }
TEST_CASE_TEMPLATE("derivatives are those of dual numbers", Policy, TURBOMAP_TEST_POLICIES) {
  check_derivatives(Policy{});
}
TEST_CASE_TEMPLATE("every factor says under every policy what it says by itself", Policy, TURBOMAP_TEST_POLICIES) {
  check_factors(Policy{});
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
