// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The marginal prior in problems on a device: the optimum of all frames is kept, and windows are what the host makes
/// of them.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "marginal_prior_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("linearised at the optimum of all frames, the prior keeps that optimum") {
  const stream on;
  check_chain_optimum(on.policy());
}

TEST_CASE("a window of three frames that slides is near to all frames at once, one that forgets is not") {
  const stream on;
  check_sliding_window(on.policy());
}

TEST_CASE("a window of three frames that slides is that of the host, to the same bits each time") {
  const stream on;
  check_windows_as_on_host(on.policy());
}

}  // namespace
