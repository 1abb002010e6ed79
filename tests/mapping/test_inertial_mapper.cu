// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Local mapping in inertial mode on a device: it does what it does on the host, leaves the host's map within rounding, and the
/// same bits each time. Only in full builds: a whole mapper under nvcc.

#include <thrust/detail/seq.h>
#include <thrust/system/cuda/execution_policy.h>

#include "adjustment/adjustment_results.hpp"
#include "inertial/inertial_state_distance.hpp"
#include "inertial_fault_cases.hpp"
#include "inertial_mapper_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::precision;

using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                             turbomap::precision_list<precision::mixed, precision::float64>>;

/// What a run leaves on a device: the same bits each time, and what it leaves on the host, within rounding.
/// \param run  of a policy, with adjustments in a precision
template <class Run>
void check_as_on_host(Run&& run) {
  const stream on;
  for (const auto numbers : {precision::mixed, precision::float64}) {
    CAPTURE(static_cast<int>(numbers));
    const auto one = run(on.policy(), numbers);
    CHECK(same_bits(one, run(on.policy(), numbers)));
    const double off = distance(one, run(thrust::seq, numbers));
    MESSAGE("off the host's map by " << off);
    CHECK(off <= (numbers == precision::float64 ? 1e-9 : 5e-5));  // measured: 1e-12 and 4e-6
  }
}

TEST_CASE("keyframes are culled, and the chain of motions stays whole; the same bits each time, and the host's map") {
  check_as_on_host(
      [](const auto& policy, precision numbers) { return check_chain<mapped_inertial, methods>(policy, numbers); });
}

TEST_CASE(
    "the IMU is initialised in the run, and mapping goes on with it; the same bits each time, and the host's map") {
  check_as_on_host(
      [](const auto& policy, precision numbers) { return check_initialised_in_run<methods>(policy, numbers); });
}

TEST_CASE("samples that cannot be integrated: said by name, and mapping goes on without them") {
  check_damaged_samples(stream{}.policy());
}
TEST_CASE("motions and states that cannot be used: each is reported with its keyframe, and mapping goes on") {
  check_reported_motions(stream{}.policy());
}
TEST_CASE("a body that is never accelerated: not initialised, and mapping goes on by what it sees") {
  check_never_accelerated(stream{}.policy());
}

}  // namespace
