// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// test_device_faults.cu with an IMU: the n-th allocation, launch, copy or wait fails, for every n, once or with all after it. An
// exception, a sound map, nothing pinned, and the next call does the work. Only in full builds: a whole mapper under nvcc.

#include "support/failing_device.cuh"

#include <thrust/system/cuda/execution_policy.h>

#include "inertial_failure_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using methods = turbomap::adjustment_methods<turbomap::solver_list<turbomap::reduced_solver::dense>,
                                             turbomap::precision_list<turbomap::precision::mixed>>;

template <class Failure, class Error>
int failures_with_imu() {
  const stream on;
  const int met = map_inertial_with_failures<Failure, Error, methods>(on.policy(), 20);
  CHECK(cudaGetLastError() == cudaSuccess);
  return met;
}

TEST_CASE("with an IMU, every allocation of device memory may fail, and all after it") {
  CHECK(failures_with_imu<failure_of<allocations, true>, std::bad_alloc>() > 10);
}

TEST_CASE("with an IMU, every launch, copy and wait may fail, once or as of a lost device") {
  CHECK(failures_with_imu<failure_of<work, false>, turbomap::device_error>() > 500);
  CHECK(failures_with_imu<failure_of<work, true>, turbomap::device_error>() > 500);
}

}  // namespace
