// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Visual-inertial problems on a device: what the host computes within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "inertial_solver_cases.hpp"
#include "support/stream.cuh"
#include "undetermined_cases.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE("every solver in every precision: as on the host, and the same bits each time; held unknowns stay") {
  const stream on;
  for (const bool some_are_held : {false, true}) {
    CAPTURE(some_are_held);
    check_solvers(on.policy(), some_are_held);
  }
}

TEST_CASE("a velocity that nothing touches is counted, and stays") { check_untouched_velocity(stream{}.policy()); }
TEST_CASE("a heading that is free has all frames in common: none of its unknowns is counted") {
  check_free_heading(stream{}.policy());
}
TEST_CASE("two frames that are joined to each other only: none of their unknowns is counted") {
  check_untied_edge(stream{}.policy());
}
TEST_CASE("a frame with one landmark: none of its unknowns is counted; with none, all are") {
  check_one_landmark(stream{}.policy());
}

}  // namespace
