// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The loop of local mapping on a device with its adjustments: what it decides is what the host decides. Full builds compile it, and
// tests/same_architectures.sh for several architectures.

#include <thrust/system/cuda/execution_policy.h>

#include "local_mapper_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("decisions of runs with adjustments, to be compared with those of other compilers and architectures") {
  const stream on;
  CHECK(print_adjusted_decisions(on.policy()) == print_adjusted_decisions(sequential_policy{}));
}

}  // namespace
