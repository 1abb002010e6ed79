// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses to Sophus and back. Debian 12 has no package of it: without its headers this says 'skipped'.

#include <doctest/doctest.h>

#include "support/support.hpp"

#if __has_include(<sophus/se3.hpp>)

#include <stdexcept>
#include <turbomap/interop/sophus.hpp>

using namespace turbomap;

TEST_CASE_TEMPLATE("a pose goes to Sophus and back", T, float, double) {
  Eigen::Matrix<T, 6, 1> tangent;
  tangent << T(1), T(-2), T(3), T(0.1), T(-0.2), T(0.3);
  const auto expected = Sophus::SE3<T>::exp(tangent);
  const rigid_transform<T> pose = from_sophus(expected);
  CHECK((to_sophus(pose).matrix() - expected.matrix()).norm() < T(1e-5));
  CHECK((to_eigen(pose).matrix() - expected.matrix()).norm() < T(1e-5));
}

TEST_CASE("a pose that is none is refused, not passed on to Sophus, which ends the program") {
  rigid_transform<double> pose;
  pose.qw = 2;
  CHECK_THROWS_AS(to_sophus(pose), std::invalid_argument);
}

#else

TEST_CASE("Sophus") { turbomap_test::skip("Sophus is not installed"); }

#endif
