// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Linear triangulation against the singular value decomposition of the same system.

#include <turbomap/matching/triangulation.hpp>

#include <cmath>
#include <cstring>
#include <random>

#include <doctest/doctest.h>

#include "reference/larger_or_nan.hpp"
#include "reference/two_views.hpp"

namespace {

using turbomap_test::oracle_pose;
using decision = turbomap::strict<double>;

turbomap::isometry<decision> to_library(const oracle_pose& T) {
  turbomap::isometry<decision> r;
  for (int i = 0; i < 9; ++i) r.R.m[i] = T.R(i / 3, i % 3);
  r.t = {T.t.x(), T.t.y(), T.t.z()};
  return r;
}
turbomap::vec3<decision> to_library(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3d from_library(const turbomap::vec3<decision>& v) { return {v.x.value, v.y.value, v.z.value}; }

struct generator {
  std::mt19937 random{7};
  double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  Eigen::Vector3d direction() {
    std::normal_distribution<double> g;
    return Eigen::Vector3d(g(random), g(random), g(random)).normalized();
  }
  oracle_pose pose(double angle, double length) {
    return {Eigen::AngleAxisd(angle, direction()).toRotationMatrix(), length * direction()};
  }
};

/// Worst relative error of the position over random pairs of rays; `noise` turns the second ray, in radians. `least_z` is the
/// least z of a unit ray: rays are scaled to z = 1, so a small one makes the system stiff.
double worst_error(double noise, double least_z, double low, double high, bool behind = false, bool precise = true) {
  generator g;
  double worst = 0;
  for (int i = 0; i < 20000;) {
    const oracle_pose a = g.pose(g(0, 3), g(0, 5)), b = g.pose(g(0, 0.5), g(0.1, 1)) * a;
    const Eigen::Vector3d x = a.inverse() * (std::exp(g(std::log(low), std::log(high))) * g.direction());
    Eigen::Vector3d ray_a = (a * x).normalized(), ray_b = (b * x).normalized();
    if (noise > 0) ray_b = (ray_b + noise * g.direction()).normalized();
    const auto usable = [&](double z) { return behind ? z < -least_z : z > least_z; };
    if (!usable(ray_a.z()) || !usable(ray_b.z())) continue;
    if ((a.R.transpose() * ray_a).dot(b.R.transpose() * ray_b) > 0.9998) continue;
    ++i;
    Eigen::Vector3d expected;
    bool shaky = false;
    REQUIRE(oracle_triangulate(a, ray_a, b, ray_b, expected, shaky));
    turbomap::vec3<decision> got{0, 0, 0};
    REQUIRE(turbomap::triangulate(to_library(a), to_library(ray_a), to_library(b), to_library(ray_b), got, precise));
    const double error = (from_library(got) - expected).norm() / ((a * expected).norm() + a.t.norm());
    worst = turbomap_test::larger_or_nan(worst, error);
    if (noise == 0) CHECK((expected - x).norm() < 1e-6 * ((a * x).norm() + a.t.norm()));
  }
  return worst;
}

TEST_CASE("exact rays meet in the point") {
  CHECK(worst_error(0, 0.3, 0.5, 20) < 1e-9);
  CHECK(worst_error(0, 0.02, 0.5, 20) < 1e-9);
  CHECK(worst_error(0, 0.3, 0.5, 20, true) < 1e-9);
}
TEST_CASE("rays that miss each other by a pixel or two") {
  CHECK(worst_error(0.005, 0.3, 0.5, 10) < 1e-9);
  CHECK(worst_error(0.005, 0.02, 0.5, 10) < 1e-9);
  CHECK(worst_error(0.005, 0.3, 0.5, 10, true) < 1e-9);
}

TEST_CASE("in a hurry: far below a pixel") {
  CHECK(worst_error(0, 0.3, 0.5, 20, false, false) < 1e-7);
  CHECK(worst_error(0, 0.0001, 0.5, 20, false, false) < 1e-4);
  CHECK(worst_error(0.005, 0.3, 0.5, 10, false, false) < 1e-6);
}

TEST_CASE("the null vector of a diagonal matrix is an axis") {
  for (int axis = 0; axis < 4; ++axis) {
    turbomap::symmetric4<double> M{2, 0, 0, 0, 3, 0, 0, 5, 0, 7};
    (axis == 0 ? M.m00 : axis == 1 ? M.m11 : axis == 2 ? M.m22 : M.m33) = axis == 2 ? 0 : 0.5;
    double v[4];
    turbomap::least_eigenvector(M, v);
    for (int i = 0; i < 4; ++i) CHECK((v[i] != 0) == (i == axis));
  }
}

TEST_CASE("a point at infinity is none") {
  // Two cameras side by side that look along z: parallel rays meet where the fourth coordinate is 0.
  oracle_pose a, b;
  b.t = {-0.5, 0, 0};
  turbomap::vec3<decision> x{0, 0, 0};
  const bool found =
      turbomap::triangulate(to_library(a), to_library({0, 0, 1}), to_library(b), to_library({0, 0, 1}), x);
  if (found) CHECK(std::abs(x.z.value) > 1e6);
  // A ray of length zero (a pixel that no ray reaches) sees nothing in particular, and must not trap.
  turbomap::triangulate(to_library(a), to_library({0, 0, 0}), to_library(b), to_library({0, 0, 0}), x);
}

TEST_CASE("float and double instances work on plain numbers") {
  const oracle_pose a;
  oracle_pose b;
  b.t = {-1, 0, 0};
  const auto cast_pose = [](const oracle_pose& T) {
    turbomap::isometry<float> r;
    for (int i = 0; i < 9; ++i) r.R.m[i] = static_cast<float>(T.R(i / 3, i % 3));
    r.t = {static_cast<float>(T.t.x()), static_cast<float>(T.t.y()), static_cast<float>(T.t.z())};
    return r;
  };
  turbomap::vec3<float> x{};
  REQUIRE(turbomap::triangulate<float>(cast_pose(a), {0.5F, 0.25F, 1}, cast_pose(b), {0, 0.25F, 1}, x));
  CHECK(x.x == doctest::Approx(1).epsilon(1e-3));
  CHECK(x.y == doctest::Approx(0.5).epsilon(1e-3));
  CHECK(x.z == doctest::Approx(2).epsilon(1e-3));
}

}  // namespace
