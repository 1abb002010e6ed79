// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping in inertial mode on a device: it ends within the bounds of the host, and in the same bits each time.
/// Only in full builds: a whole mapper under nvcc.

#include <thrust/system/cuda/execution_policy.h>

#include "inertial_mapper_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("keyframes are culled, and the chain of motions stays whole; the same bits each time") {
  const stream on;
  const auto one = check_chain<mapped_inertial>(on.policy());
  CHECK(same_bits(one, check_chain<mapped_inertial>(on.policy())));
}

TEST_CASE("the IMU is initialised in the run, and mapping goes on with it; the same bits each time") {
  const stream on;
  const auto one = check_initialised_in_run(on.policy());
  CHECK(same_bits(one, check_initialised_in_run(on.policy())));
}

}  // namespace
