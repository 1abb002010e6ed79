// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Residuals and factors of inertial states on a device: zero where prediction says, and with their derivatives what
/// the host computes within rounding. That these are the derivatives of dual numbers is tested on the host: 32 of
/// them in one kernel compile for minutes.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "inertial_residual_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("what was predicted has no residual") {
  const stream on;
  check_predicted(on.policy());
}
TEST_CASE("every factor says what it says on the host, to the same bits each time") {
  const stream on;
  check_factors(on.policy());
}

}  // namespace
