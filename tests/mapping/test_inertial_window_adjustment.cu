// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Inertial adjustment of a map on a device: what the host leaves, within rounding, and the same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "border_prior_cases.hpp"
#include "inertial_divergence_cases.hpp"
#include "inertial_initialisation_cases.hpp"
#include "inertial_window_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("window and result are those of the definition") {
  const stream on;
  check_definition(on.policy());
}

TEST_CASE("windows one after the other, with outliers: as on the host") {
  const stream on;
  check_outliers(on.policy());
}

TEST_CASE("the large window where tracking is strong") {
  const stream on;
  check_large_window(on.policy());
}

TEST_CASE("while the estimates are young the map may turn about its first keyframe") {
  const stream on;
  check_young_map_turns(on.policy());
}

TEST_CASE("a window of which keyframes were culled") {
  const stream on;
  check_culled_window(on.policy());
}

TEST_CASE("changed meanwhile: nothing is written") {
  const stream on;
  check_changed_meanwhile(on.policy());
}

TEST_CASE("stopped before it began, a dead keyframe, bad options: the map stays") {
  const stream on;
  check_refused(on.policy());
}

TEST_CASE("IMU data that cannot be used: refused, or noted and passed over") {
  const stream on;
  check_unusable_imu_data(on.policy());
}

TEST_CASE("windows after an initialisation") {
  const stream on;
  check_after_initialisation(on.policy());
}

TEST_CASE("no step was found: map and stage are as if nothing had been tried") {
  const stream on;
  check_divergence(on.policy());
}

TEST_CASE("a damping that lets nothing move is given up") {
  const stream on;
  check_endless_damping(on.policy());
}

TEST_CASE("a prior of the keyframe before a window keeps the optimum of all keyframes") {
  const stream on;
  check_keeps_optimum(on.policy());
}

TEST_CASE("the prior keeps that optimum in mixed precision") {
  const stream on;
  check_keeps_optimum(on.policy(), {5}, to_the_end_in_mixed_precision());
}

}  // namespace
