// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Lists of what indices have found, on a device.

#include <thrust/system/cuda/execution_policy.h>

#include "found_list_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("as a loop writes them") {
  const stream on;
  check_found_lists(on.policy());
}

}  // namespace
