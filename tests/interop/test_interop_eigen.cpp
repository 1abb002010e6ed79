// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses and vectors to Eigen and back.

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <limits>
#include <random>
#include <stdexcept>
#include <turbomap/interop/eigen.hpp>

using namespace turbomap;

namespace {

template <class T>
Eigen::Transform<T, 3, Eigen::Isometry> random_pose(std::mt19937& random) {
  std::normal_distribution<T> normal;
  Eigen::Quaternion<T> q(normal(random), normal(random), normal(random), normal(random));
  auto pose = Eigen::Transform<T, 3, Eigen::Isometry>::Identity();
  pose.linear() = q.normalized().toRotationMatrix();
  pose.translation() << normal(random), normal(random), normal(random);
  return pose;
}

}  // namespace

TEST_CASE_TEMPLATE("a pose goes to Eigen and back, and maps points alike", T, float, double) {
  const T small = T(20) * std::numeric_limits<T>::epsilon();
  std::mt19937 random(5);
  for (int i = 0; i < 100; ++i) {
    const auto expected = random_pose<T>(random);
    const rigid_transform<T> pose = from_eigen(expected);
    const Eigen::Matrix<T, 4, 4> matrix = expected.matrix();
    const rigid_transform<T> of_matrix = from_eigen(matrix);
    CHECK((to_eigen(of_matrix).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < small);
    CHECK((to_eigen(pose).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < small);
    const Eigen::Matrix<T, 3, 1> x(T(0.5), T(-2), T(3));
    const vec3<T> y = to_isometry<T>(pose) * from_eigen(x);
    CHECK((expected * x - to_eigen(y)).norm() < small * 4);
  }
}

TEST_CASE_TEMPLATE("a pose that is not quite of unit length is a rigid motion in Eigen too", T, float, double) {
  const T small = T(20) * std::numeric_limits<T>::epsilon();
  std::mt19937 random(6);
  for (const T by : {T(1 + 4e-4), T(1 - 4e-4), T(1)}) {
    const auto expected = random_pose<T>(random);
    rigid_transform<T> pose = from_eigen(expected);
    pose.qx *= by, pose.qy *= by, pose.qz *= by, pose.qw *= by;
    CHECK((to_eigen(pose).matrix() - expected.matrix()).cwiseAbs().maxCoeff() < small);
    const Eigen::Matrix<T, 3, 1> x(T(0.5), T(-2), T(3));
    CHECK((to_eigen(pose) * x - to_eigen(to_isometry<T>(pose) * from_eigen(x))).norm() < small * 4);
  }
}

TEST_CASE("a rotation by 180 degrees has a quaternion too") {
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(EIGEN_PI, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
    CHECK((to_eigen(from_eigen(pose)).matrix() - pose.matrix()).norm() < 1e-14);
  }
}

TEST_CASE("quaternion and vector are taken as they are") {
  const Eigen::Quaternionf q(0.5F, 0.5F, -0.5F, 0.5F);
  const auto pose = from_eigen(q, Eigen::Vector3f(1, 2, 3));
  CHECK(pose.qw == 0.5F);
  CHECK(pose.qx == 0.5F);
  CHECK(pose.qy == -0.5F);
  CHECK(pose.qz == 0.5F);
  CHECK(pose.tx == 1);
  CHECK(pose.ty == 2);
  CHECK(pose.tz == 3);
  CHECK(to_eigen(vec2<float>{4, 5}) == Eigen::Vector2f(4, 5));
}

TEST_CASE("what is no rigid motion is refused") {
  Eigen::Affine3d pose = Eigen::Affine3d::Identity();
  CHECK_NOTHROW(from_eigen(pose));
  pose.linear() *= 1.1;
  CHECK_THROWS_AS(from_eigen(pose), std::invalid_argument);
  pose.linear() = Eigen::Vector3d(1, 1, -1).asDiagonal();
  CHECK_THROWS_AS(from_eigen(pose), std::invalid_argument);
  pose = Eigen::Affine3d::Identity();
  pose.translation().y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(from_eigen(pose), std::invalid_argument);
  pose = Eigen::Affine3d::Identity();
  pose.linear()(1, 1) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(from_eigen(pose), std::invalid_argument);
  Eigen::Projective3d map = Eigen::Projective3d::Identity();
  CHECK_NOTHROW(from_eigen(map));
  CHECK_NOTHROW(from_eigen(Eigen::Matrix4d::Identity().eval()));
  CHECK_THROWS_AS(from_eigen(Eigen::Matrix4d::Zero().eval()), std::invalid_argument);
  map.matrix()(3, 0) = 0.5;
  CHECK_THROWS_AS(from_eigen(map.matrix()), std::invalid_argument);
  CHECK_THROWS_AS(from_eigen(map), std::invalid_argument);
  CHECK_NOTHROW(from_eigen(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1e308, 1e308, 0)));
  CHECK_THROWS_WITH(
      from_eigen(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, std::numeric_limits<double>::infinity(), 0)),
      "turbomap: translation = inf: must be finite");
  CHECK_THROWS_WITH(from_eigen(Eigen::Quaterniond(2, 0, 0, 0), Eigen::Vector3d::Zero().eval()),
                    "turbomap: quaternion norm = 2: must be 1");
}
