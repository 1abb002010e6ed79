// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The n-th allocation of device or pinned memory fails, alone or with all after it, for every n, while keyframes are inserted
// and mapped on a device; then the n-th launch, copy or wait, and all of them from the n-th on, as when the device is lost.
// Each time: an exception, a sound map, a store as it was, nothing pinned, and the next call does the work. The same of what
// loop closing calls. With an IMU: test_inertial_device_faults.cu. A device that is really lost: test_lost_device.cu.

#include "support/failing_device.cuh"

#include <thrust/system/cuda/execution_policy.h>

#include "no_memory_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using map_type = mapped_by<pinhole_camera>;
using device_run = mapping_run<map_type, stream_policy, turbomap::local_adjustment<map_type, stream_policy>>;

template <class Failure, class Error>
failures_met failures_on_device(int keyframes) {
  const stream on;
  const auto c = case_of_failures();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  device_run run(scene, c.options, {}, on.policy(), store_of_failures());
  const failures_met met = map_with_failures<Failure, Error>(run, scene, keyframes);
  CHECK(cudaGetLastError() == cudaSuccess);  // no error is left behind for somebody else's next call
  return met;
}

template <class Failure, class Error>
closing_failures closing_on_device() {
  const stream on;
  const auto c = case_of_failures();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  device_run run(scene, c.options, {}, on.policy(), store_of_failures());
  run.steps(10);
  const closing_failures met = close_with_failures<Failure, Error>(run);
  CHECK(cudaGetLastError() == cudaSuccess);
  return met;
}

TEST_CASE("every allocation of device memory may fail, and all after it") {
  const auto met = failures_on_device<failure_of<allocations, true>, std::bad_alloc>(10);
  CHECK(met.inserting > 2);
  CHECK(met.processing > 20);
  CHECK(met.adjusted > 5);
}

/// The allocation of this number fails in the first try of a call, and no other.
struct single_failure {
  static inline long number = 0;
  static inline int met = 0;
  explicit single_failure(int tries) { allocations = {tries == 0 ? number : -1, false}; }
  single_failure(const single_failure&) = delete;
  single_failure& operator=(const single_failure&) = delete;
  ~single_failure() {
    met += allocations.failed ? 1 : 0;
    allocations = {};
    cudaDeviceSynchronize();
  }
};

TEST_CASE("a single allocation of device memory may fail, whichever it is") {
  int all = 0, noticed = 0;
  for (single_failure::number = 0;; ++single_failure::number) {
    CAPTURE(single_failure::number);
    single_failure::met = 0;
    const auto met = failures_on_device<single_failure, std::bad_alloc>(4);
    if (single_failure::met == 0) break;  // no call has so many
    all += single_failure::met, noticed += met.inserting + met.processing;
  }
  MESSAGE(single_failure::number << " in a call, " << all << " failed, " << noticed << " were noticed");
  CHECK(all > 20);
  CHECK(noticed < all);  // what lies idle is given back, and the memory asked for again
}

TEST_CASE("every launch, copy and wait may fail") {
  const auto once = failures_on_device<failure_of<work, false>, turbomap::device_error>(4);
  const auto lost = failures_on_device<failure_of<work, true>, turbomap::device_error>(4);
  for (const auto& met : {once, lost}) {
    CHECK(met.inserting >= 8);  // a copy and a wait each
    CHECK(met.processing > 100);
    CHECK(met.adjusted > 1);
  }
}

TEST_CASE("every allocation, launch, copy and wait of what loop closing calls may fail") {
  const auto memory = closing_on_device<failure_of<allocations, true>, std::bad_alloc>();
  CHECK(memory.adjusting > 0);
  const auto once = closing_on_device<failure_of<work, false>, turbomap::device_error>();
  const auto lost = closing_on_device<failure_of<work, true>, turbomap::device_error>();
  for (const auto& met : {once, lost}) {
    CHECK(met.fusing > 10);
    CHECK(met.adjusting > 50);
    CHECK(met.updating > 0);
  }
}

}  // namespace
