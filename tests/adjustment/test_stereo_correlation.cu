// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Errors of u and u_right that are not independent, on a device: what holds on the host.

#include <thrust/system/cuda/execution_policy.h>

#include "stereo_correlation_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("chi2 and cost of an adjustment are those of the covariance") {
  const stream on;
  check_correlated_adjustment(on.policy());
}

TEST_CASE("a weak link is estimated better") {
  const stream on;
  check_weak_link(on.policy());
}

TEST_CASE("poses alone: outliers by the covariance") {
  const stream on;
  check_correlated_poses(on.policy());
}

TEST_CASE("a correlation that is none is refused") {
  const stream on;
  check_bad_correlations(on.policy());
}

}  // namespace
