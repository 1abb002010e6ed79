// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The long run of test_byte_budget.cpp on a device. Only in full builds: a whole mapper under nvcc.

#include <thrust/system/cuda/execution_policy.h>

#include "soak_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE(
    "a long run on a device: the map does not grow, nothing is confused; from 3000 keyframes on, memory and time "
    "stay") {
  const stream on;
  check_long_run(on.policy());
}

}  // namespace
