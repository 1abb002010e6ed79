// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Poses from and to manif. Not included by anything else: only whoever includes this file needs manif.

#include <manif/SE3.h>

#include "../config.hpp"
#include "eigen.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// manif::SE3, or a map of one, as a pose `T_ab`. Throws std::invalid_argument when a number is not finite or the quaternion is not
/// of unit length within 1e-3.
template <class Derived>
rigid_transform<typename Derived::Scalar> from_manif(const manif::SE3Base<Derived>& T_ab) {
  using T = typename Derived::Scalar;
  const Eigen::Quaternion<T> q = T_ab.quat();
  const Eigen::Matrix<T, 3, 1> t = T_ab.translation();
  return from_eigen(q, t);
}

/// A pose `T_ab` as manif::SE3, its quaternion normalised. Throws as from_manif().
template <class T>
manif::SE3<T> to_manif(const rigid_transform<T>& T_ab) {
  const Eigen::Quaternion<T> q(T_ab.qw, T_ab.qx, T_ab.qy, T_ab.qz);
  const Eigen::Matrix<T, 3, 1> t = to_eigen(translation(T_ab));
  from_eigen(q, t);  // checks it
  return manif::SE3<T>(t, q.normalized());
}

TURBOMAP_END_NAMESPACE
