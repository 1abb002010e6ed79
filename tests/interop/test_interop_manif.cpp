// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Poses to manif and back. Debian 12 has no package of it: without its headers this says 'skipped'.

#include <doctest/doctest.h>

#include "support/support.hpp"

#if __has_include(<manif/SE3.h>)

#include <stdexcept>
#include <turbomap/interop/manif.hpp>

using namespace turbomap;

TEST_CASE_TEMPLATE("a pose goes to manif and back", T, float, double) {
  const auto expected = manif::SE3<T>(T(1), T(-2), T(3), T(0.1), T(-0.2), T(0.3));
  const rigid_transform<T> pose = from_manif(expected);
  CHECK((to_manif(pose).transform() - expected.transform()).norm() < T(1e-5));
  CHECK((to_eigen(pose).matrix() - expected.transform()).norm() < T(1e-5));
}

TEST_CASE("a pose that is none is refused") {
  rigid_transform<double> pose;
  pose.qw = 2;
  CHECK_THROWS_AS(to_manif(pose), std::invalid_argument);
}

#else

TEST_CASE("manif") { turbomap_test::skip("manif is not installed"); }

#endif
