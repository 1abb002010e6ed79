// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The recorded linear system on a device: eliminated, solved and substituted as recorded and as on the host, with the
/// same bits each time.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "bundle/schur_check.hpp"
#include "readers/schur_system.hpp"

#include <vector>

#include "adjustment/adjustment_results.hpp"
#include "support/stream.cuh"
#include "support/support.hpp"

namespace {

using namespace turbomap_test;
using turbomap_bundle::relative_difference;

/// What the library makes of the system: the reduced one, and the steps of the landmarks from the recorded ones.
struct reduced {
  std::vector<double> S, rhs, xl;
};

template <class Policy>
reduced reduce(const Policy& policy, const turbomap::schur_system& s, double lambda) {
  turbomap::context<Policy> ctx{policy};
  turbomap_bundle::recorded_schur<Policy> ours(ctx, s);
  reduced r;
  ours.reduce(lambda, r.S, r.rhs);
  r.xl = ours.substitute(s.xp);
  return r;
}

TEST_CASE("the recorded system is reduced, told singular, and solved with damping") {
  const auto folder = data("vi-schur-system");
  if (!folder) return;
  const stream on;
  const auto found = turbomap_bundle::check_schur(on.policy(), turbomap::read_schur_system(*folder), 1);
  CAPTURE(found.dump());
  CHECK(found["unknowns"] == 390);
  CHECK(found["landmarks"] == 1115);
  CHECK(found["good"] == true);
}

TEST_CASE("as on the host, and the same bits each time") {
  const auto folder = data("vi-schur-system");
  if (!folder) return;
  const stream on;
  const auto s = turbomap::read_schur_system(*folder);
  for (const double lambda : {0.0, 1e-3, 1e4}) {
    CAPTURE(lambda);
    const auto a = reduce(on.policy(), s, lambda), again = reduce(on.policy(), s, lambda);
    CHECK(same_bits(a.S, again.S));
    CHECK(same_bits(a.rhs, again.rhs));
    CHECK(same_bits(a.xl, again.xl));
    const auto host = reduce(thrust::seq, s, lambda);
    CHECK(relative_difference(a.S, host.S) <= 1e-12);
    CHECK(relative_difference(a.rhs, host.rhs) <= 1e-9);
    // Some landmarks are hardly determined: undamped, rounding alone moves them, from the recorded ones as well.
    CHECK(relative_difference(a.xl, host.xl) <= (lambda > 0 ? 1e-9 : turbomap_bundle::schur_bounds{}.xl));
  }
}

}  // namespace
