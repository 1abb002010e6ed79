// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Products of small vectors, matrices and rigid transforms against Eigen.

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <random>
#include <turbomap/math/linear.hpp>
#include <turbomap/math/strict.hpp>

using namespace turbomap;

namespace {

struct random_numbers {
  std::mt19937_64 engine{11};
  double operator()() { return std::uniform_real_distribution<double>(-2, 2)(engine); }
  vec3<double> vector() { return {(*this)(), (*this)(), (*this)()}; }
  mat3<double> matrix() {
    mat3<double> m;
    for (double& v : m.m) v = (*this)();
    return m;
  }
  rigid_transform<double> transform() {
    const Eigen::Quaterniond q = Eigen::Quaterniond((*this)(), (*this)(), (*this)(), (*this)()).normalized();
    return {q.x(), q.y(), q.z(), q.w(), (*this)(), (*this)(), (*this)()};
  }
};

Eigen::Vector3d eigen(const vec3<double>& a) { return {a.x, a.y, a.z}; }
Eigen::Matrix3d eigen(const mat3<double>& A) { return Eigen::Matrix<double, 3, 3, Eigen::RowMajor>(A.m); }
Eigen::Isometry3d eigen(const rigid_transform<double>& T) {
  return Eigen::Translation3d(T.tx, T.ty, T.tz) * Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz);
}

}  // namespace

TEST_CASE("vectors") {
  random_numbers random;
  for (int i = 0; i < 50; ++i) {
    const auto a = random.vector(), b = random.vector();
    CHECK((eigen(a + b) - (eigen(a) + eigen(b))).norm() == 0);
    CHECK((eigen(a - b) - (eigen(a) - eigen(b))).norm() == 0);
    CHECK((eigen(2.5 * a) - 2.5 * eigen(a)).norm() == 0);
    CHECK(dot(a, b) == doctest::Approx(eigen(a).dot(eigen(b))).epsilon(1e-13));
    CHECK((eigen(cross(a, b)) - eigen(a).cross(eigen(b))).norm() < 1e-14);
    CHECK(squared_norm(a) == doctest::Approx(eigen(a).squaredNorm()).epsilon(1e-14));
    CHECK(norm(a) == doctest::Approx(eigen(a).norm()).epsilon(1e-14));
    CHECK(norm(cast<strict<double>>(a)).value == doctest::Approx(eigen(a).norm()).epsilon(1e-14));
  }
}

TEST_CASE("matrices") {
  random_numbers random;
  for (int i = 0; i < 50; ++i) {
    const auto A = random.matrix(), B = random.matrix();
    const auto x = random.vector();
    CHECK((eigen(A * x) - eigen(A) * eigen(x)).norm() < 1e-14);
    CHECK((eigen(A * B) - eigen(A) * eigen(B)).norm() < 1e-13);
    CHECK((eigen(transpose(A)) - eigen(A).transpose()).norm() == 0);
  }
}

TEST_CASE("rigid transforms: rotation, product, inverse, camera centre") {
  random_numbers random;
  for (int i = 0; i < 50; ++i) {
    const auto P = random.transform(), Q = random.transform();
    const auto p = to_isometry<double>(P), q = to_isometry<double>(Q);
    const auto x = random.vector();
    CHECK((eigen(p.R) - eigen(P).linear()).norm() < 1e-14);
    CHECK((eigen(p * x) - eigen(P) * eigen(x)).norm() < 1e-13);
    CHECK((eigen((p * q) * x) - eigen(P) * (eigen(Q) * eigen(x))).norm() < 1e-13);
    CHECK((eigen(inverse(p) * (p * x)) - eigen(x)).norm() < 1e-13);
    CHECK((eigen(camera_centre(p)) - eigen(P).inverse().translation()).norm() < 1e-13);
    CHECK((eigen(p * camera_centre(p))).norm() < 1e-13);
  }
}

TEST_CASE("a float transform is used in strict double as stored") {
  rigid_transform<float> T;
  T.qz = 0.6F, T.qw = 0.8F, T.tx = 0.1F;
  const auto t = to_isometry<strict<double>>(T);
  CHECK(t.t.x.value == static_cast<double>(0.1F));
  CHECK(t.R(2, 2).value == 1);
  CHECK(t.R(1, 0).value == doctest::Approx(2 * 0.6 * 0.8).epsilon(1e-6));
  CHECK(t.R(0, 1).value == -t.R(1, 0).value);
}

TEST_CASE("a quaternion that is off by more than rounding is scaled to unit length, others are taken as they are") {
  turbomap::rigid_transform<double> T{0.1, -0.3, 0.2, 0, 50, -1000, 20};
  T.qw = std::sqrt(1 - 0.14);
  const auto scaled = [&](double by) {
    auto S = T;
    S.qx *= by, S.qy *= by, S.qz *= by, S.qw *= by;
    return S;
  };
  const auto exact = turbomap::to_isometry<double>(T);
  for (const double by : {1 + 4e-4, 1 - 4e-4, 1 + 1e-6}) {
    const auto E = turbomap::to_isometry<double>(scaled(by));
    for (int i = 0; i < 9; ++i) CHECK(std::abs(E.R.m[i] - exact.R.m[i]) < 1e-15);
    CHECK(turbomap::norm(turbomap::camera_centre(E) - turbomap::camera_centre(exact)) < 1e-11);
  }
  const auto rounded = turbomap::cast<double>(turbomap::cast<float>(scaled(1 + 1e-7)));
  const auto as_it_is = turbomap::rotation(rounded), used = turbomap::to_isometry<double>(rounded).R;
  for (int i = 0; i < 9; ++i) CHECK(used.m[i] == as_it_is.m[i]);
  CHECK(used.m[0] != exact.R.m[0]);
  const auto none = turbomap::to_isometry<double>(scaled(0));
  for (int i = 0; i < 9; ++i) CHECK(none.R.m[i] == (i % 4 == 0 ? 1 : 0));
}
