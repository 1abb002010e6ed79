// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Frames without a pose on a device: what flat_frames_cases.hpp asks for.

#include <doctest/doctest.h>

#include <thrust/system/cuda/execution_policy.h>

#include "flat_frames_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("a graph of frames in the plane, without landmarks") { check_flat_graph(stream{}.policy()); }
TEST_CASE("landmarks that see one, two or three unknowns of a frame") { check_flat_landmarks(stream{}.policy()); }

}  // namespace
