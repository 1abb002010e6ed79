// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Duplicate fusion on a device: the map of the sequential oracle, in both modes.

#include <thrust/system/cuda/execution_policy.h>

#include "duplicate_fusion_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("a stereo pair: both modes, all merge rules") {
  const stream on;
  check_fusions(on.policy(), pinhole_rig(50), 1, 1);
}
TEST_CASE("a fisheye rig of two cameras") {
  const stream on;
  check_fusions(on.policy(), fisheye_rig(2), 100, 1);
}

}  // namespace
