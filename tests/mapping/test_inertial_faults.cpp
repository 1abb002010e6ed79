// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping whose IMU fails: samples that cannot be integrated, motions and states that cannot be used, a body that is never
// accelerated. It is said what is wrong, the map stays valid, and mapping goes on.

#include <doctest/doctest.h>

#include "inertial_fault_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE("samples that cannot be integrated: said by name, and mapping goes on without them") {
  check_damaged_samples(sequential{});
}
TEST_CASE("motions and states that cannot be used: each is reported with its keyframe, and mapping goes on") {
  check_reported_motions(sequential{});
}
TEST_CASE("a body that is never accelerated: not initialised, and mapping goes on by what it sees") {
  check_never_accelerated(sequential{});
}

}  // namespace
