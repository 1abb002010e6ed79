// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Preintegration on a device: what the host computes within rounding, and the same bits each time.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <cstring>

#include "preintegration_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("intervals are what the paper makes of them") {
  const stream on;
  check_against_oracle<double>(on.policy(), 1e-11);
  check_against_oracle<float>(on.policy(), 2e-4);
  check_sizes(on.policy());
}

TEST_CASE("two runs give the same bits") {
  const stream on;
  const imu_motion m = make_imu_motion(3, 2000, 1000);
  const auto one = preintegrate_all<double>(on.policy(), m), two = preintegrate_all<double>(on.policy(), m);
  CHECK(std::memcmp(one.data(), two.data(), one.size() * sizeof one[0]) == 0);
}

}  // namespace
