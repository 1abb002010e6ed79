// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Poses from and to Sophus. Not included by anything else: only whoever includes this file needs Sophus.

#include <sophus/se3.hpp>

#include "../config.hpp"
#include "eigen.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Sophus::SE3, or a map of one, as a pose `T_ab`. Throws std::invalid_argument when a number is not finite.
template <class Derived>
rigid_transform<typename Derived::Scalar> from_sophus(const Sophus::SE3Base<Derived>& T_ab) {
  return from_eigen(T_ab.unit_quaternion(), T_ab.translation());
}

/// A pose `T_ab` as Sophus::SE3, which holds unit quaternions only: one that is not exactly unit is normalised.
/// Throws std::invalid_argument when a number is not finite or the quaternion is not of unit length within 1e-3.
template <class T>
Sophus::SE3<T> to_sophus(const rigid_transform<T>& T_ab) {
  const Eigen::Quaternion<T> q(T_ab.qw, T_ab.qx, T_ab.qy, T_ab.qz);
  const Eigen::Matrix<T, 3, 1> t = to_eigen(translation(T_ab));
  from_eigen(q, t);  // checks it
  return Sophus::SE3<T>(q, t);
}

TURBOMAP_END_NAMESPACE
