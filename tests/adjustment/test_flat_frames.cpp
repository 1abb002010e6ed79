// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Frames without a pose, as flat_frames_cases.hpp asks for; test_flat_frames.cu asks the same of a device.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include "flat_frames_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE("a graph of frames in the plane, without landmarks") { check_flat_graph(turbomap_test::sequential{}); }
TEST_CASE("landmarks that see one, two or three unknowns of a frame") {
  check_flat_landmarks(turbomap_test::sequential{});
}

}  // namespace
