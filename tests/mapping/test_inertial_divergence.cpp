// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Inertial adjustments that find no better state leave the map to the last bit. (On a device: test_inertial_window_adjustment.cu.)

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include "inertial_divergence_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("no step was found: map and stage are as if nothing had been tried", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_divergence(Policy{});
}

TEST_CASE_TEMPLATE("a damping that lets nothing move is given up", Policy, TURBOMAP_TEST_POLICIES) {
  check_endless_damping(Policy{});
}

}  // namespace
