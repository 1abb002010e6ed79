// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Vectors and poses from and to Eigen, by value. The library's own structs have no Eigen members.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <type_traits>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/linear.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A 3-vector.
template <class T>
Eigen::Matrix<T, 3, 1> to_eigen(const vec3<T>& a) {
  return {a.x, a.y, a.z};
}
/// A pixel.
template <class T>
Eigen::Matrix<T, 2, 1> to_eigen(const vec2<T>& a) {
  return {a.x, a.y};
}
/// A pose `T_ab` as Eigen::Isometry3: the rotation that the library itself uses (to_isometry()), so both map a point alike.
template <class T>
Eigen::Transform<T, 3, Eigen::Isometry> to_eigen(const rigid_transform<T>& T_ab) {
  const mat3<T> R = to_isometry<T>(T_ab).R;
  auto result = Eigen::Transform<T, 3, Eigen::Isometry>::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) result.linear()(r, c) = R(r, c);
  result.translation() = to_eigen(translation(T_ab));
  return result;
}

/// A fixed-size vector of three, a row or a column, or an expression of it.
template <class Derived, std::enable_if_t<Derived::SizeAtCompileTime == 3, int> = 0>
vec3<typename Derived::Scalar> from_eigen(const Eigen::MatrixBase<Derived>& a) {
  const auto v = a.eval();
  return {v[0], v[1], v[2]};
}
/// A rotation and a translation as a pose `T_ab`. The quaternion is taken as it is.
/// Throws std::invalid_argument when a number is not finite or the quaternion is not of unit length within 1e-3.
template <class Q, class V>
rigid_transform<typename Q::Scalar> from_eigen(const Eigen::QuaternionBase<Q>& rotation,
                                               const Eigen::MatrixBase<V>& translation) {
  using T = typename Q::Scalar;
  const T length = rotation.norm();
  require(std::isfinite(length) && std::abs(length - T(1)) < T(1e-3), "quaternion norm", length, "must be 1");
  const vec3<T> t = from_eigen(translation);
  const T elements[3] = {t.x, t.y, t.z};
  for (const T& x : elements) require(std::isfinite(x), "translation", x, "must be finite");
  return {rotation.x(), rotation.y(), rotation.z(), rotation.w(), t.x, t.y, t.z};
}
/// Eigen::Isometry3, Affine3, or a Projective3 whose last row is (0 0 0 1), as a pose `T_ab`. Throws std::invalid_argument
/// when it is not a rigid motion: linear part not a rotation within 1e-3, a scale, a mirror, a number that is not finite.
template <class T, int Mode, int Options>
rigid_transform<T> from_eigen(const Eigen::Transform<T, 3, Mode, Options>& T_ab) {
  const Eigen::Matrix<T, 3, 3> R = T_ab.linear();
  const T error = (R.transpose() * R - Eigen::Matrix<T, 3, 3>::Identity()).cwiseAbs().maxCoeff();
  // Not 'error > 1e-3': comparisons with NaN are false, and maxCoeff() may pass over one.
  require(R.allFinite() && error <= T(1e-3), "|R^T R - I|", error, "the linear part must be a rotation");
  require(R.determinant() > T(0), "det R", R.determinant(), "the linear part must not mirror");
  if constexpr (Mode == int(Eigen::Projective)) {
    const T w = (T_ab.matrix().row(3) - Eigen::Matrix<T, 1, 4>(0, 0, 0, 1)).cwiseAbs().sum();
    require(w <= T(1e-6), "last row - (0 0 0 1)", w, "a projective map is no pose");
  }
  return from_eigen(Eigen::Quaternion<T>(R).normalized(), T_ab.translation());
}
/// A 4x4 matrix [R t; 0 1] as a pose `T_ab`: as systems without a pose class keep it. Throws as above.
template <class Derived, std::enable_if_t<Derived::RowsAtCompileTime == 4 && Derived::ColsAtCompileTime == 4, int> = 0>
rigid_transform<typename Derived::Scalar> from_eigen(const Eigen::MatrixBase<Derived>& T_ab) {
  return from_eigen(Eigen::Transform<typename Derived::Scalar, 3, Eigen::Projective>(T_ab));
}

TURBOMAP_END_NAMESPACE
