// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Rotations: exponential, logarithm, quaternion of a matrix, inverse right Jacobian; small angles, half turns, dual
// numbers.

#include <turbomap/math/dual.hpp>
#include <turbomap/math/rotation.hpp>

#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "reference/preintegration_oracle.hpp"

namespace {

using namespace turbomap_test;
using turbomap::vec3;

Eigen::Vector3d to_eigen(const vec3<double>& a) { return {a.x, a.y, a.z}; }
Eigen::Matrix3d to_eigen(const turbomap::mat3<double>& A) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(A.m);
}
vec3<double> to_vec(const Eigen::Vector3d& a) { return {a.x(), a.y(), a.z()}; }

TEST_CASE("exponential and logarithm are inverse, from no angle to half a turn") {
  std::mt19937_64 random(1);
  std::normal_distribution<double> n(0, 1);
  const double pi = 3.14159265358979323846;
  for (const double angle : {0.0, 1e-12, 1e-8, 1e-4, 0.0099, 0.0101, 0.02, 0.5, 1.5, 2.0, 2.2, 3.0, 3.14, pi - 1e-7})
    for (int k = 0; k < 30; ++k) {
      CAPTURE(angle);
      Eigen::Vector3d axis(n(random), n(random), n(random));
      if (k < 3) axis = Eigen::Vector3d::Unit(k) * 3;
      const Eigen::Vector3d w = angle * axis.normalized();
      const auto R = turbomap::rotation_exp(to_vec(w));
      CHECK((to_eigen(R) - oracle_exp(w)).norm() < 1e-15 * 10);
      CHECK((to_eigen(turbomap::rotation_log(R)) - w).norm() <= 1e-15 + 4e-15 * angle);
      const auto q = turbomap::to_rigid_transform(turbomap::isometry<double>{R, {1, 2, 3}});
      CHECK((to_eigen(turbomap::rotation(q)) - to_eigen(R)).norm() < 1e-14);
      CHECK(q.tz == 3);
      const Eigen::Matrix3d J = to_eigen(turbomap::right_jacobian_inverse(to_vec(w)));
      CHECK((J * oracle_right_jacobian(w) - Eigen::Matrix3d::Identity()).norm() < 1e-12);
      const turbomap::rotation_jacobian<double> both(to_vec(w));
      CHECK((to_eigen(both.right) - oracle_right_jacobian(w)).norm() < 1e-12);
      CHECK((to_eigen(both.exp) - oracle_exp(w)).norm() < 1e-14);
    }
}

TEST_CASE("a pose is finite where each of its numbers is") {
  turbomap::rigid_transform<double> T;
  CHECK(turbomap::is_pose(T));
  T.tx = T.ty = 1e308;
  CHECK(turbomap::is_pose(T));
  T.tz = std::numeric_limits<double>::infinity();
  CHECK_FALSE(turbomap::is_pose(T));
}

TEST_CASE("half a turn has a logarithm of length pi") {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0.6, 0, -0.8), Eigen::Vector3d(0, 0, 1)}) {
    const Eigen::Matrix3d R = 2 * axis * axis.transpose() - Eigen::Matrix3d::Identity();
    turbomap::mat3<double> A;
    for (int i = 0; i < 9; ++i) A.m[i] = R(i / 3, i % 3);
    const Eigen::Vector3d w = to_eigen(turbomap::rotation_log(A));
    CHECK(w.norm() == doctest::Approx(3.14159265358979323846).epsilon(1e-12));
    CHECK(std::abs(w.normalized().dot(axis)) == doctest::Approx(1).epsilon(1e-12));
  }
}

TEST_CASE("the logarithm of dual numbers has the derivative of the inverse right Jacobian") {
  using dual = turbomap::dual<3>;
  for (const double size : {0.0, 1e-3, 0.7, 2.5}) {
    CAPTURE(size);
    const vec3<double> w{0.6 * size, -0.48 * size, 0.64 * size};
    const vec3<dual> d{dual::variable(0, 0), dual::variable(0, 1), dual::variable(0, 2)};
    const auto r = turbomap::rotation_log(turbomap::cast<dual>(turbomap::rotation_exp(w)) * turbomap::rotation_exp(d));
    const Eigen::Matrix3d J = to_eigen(turbomap::right_jacobian_inverse(w));
    for (int c = 0; c < 3; ++c) CHECK((Eigen::Vector3d(r.x.d[c], r.y.d[c], r.z.d[c]) - J.col(c)).norm() < 1e-13);
  }
}

}  // namespace
