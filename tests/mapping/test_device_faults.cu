// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The n-th allocation of device or pinned memory fails, alone or with all after it, for every n, while keyframes are inserted
// and mapped on a device; then the n-th launch, copy or wait, and all of them from the n-th on, as when the device is lost.
// Each time: an exception, a sound map, a store as it was, nothing pinned, and the next call does the work. A device that is
// really lost: test_lost_device.cu.

#include <cuda_runtime.h>

#include <utility>

namespace turbomap_test {

/// Calls of one kind, of which some fail.
struct failing_calls {
  long left = -1;        ///< calls until one fails; below 0: none fails
  bool for_ever = true;  ///< so do all after it
  bool failed = false;   ///< one has

  bool fails() {
    if (left < 0) return false;
    if (left > 0) return --left, false;
    if (!for_ever) left = -1;
    return failed = true;
  }
};
inline failing_calls allocations, work;

inline cudaError_t counted_malloc(void** memory, std::size_t bytes) {
  return allocations.fails() ? cudaErrorMemoryAllocation : cudaMalloc(memory, bytes);
}
inline cudaError_t counted_malloc_host(void** memory, std::size_t bytes) {
  return allocations.fails() ? cudaErrorMemoryAllocation : cudaMallocHost(memory, bytes);
}
template <class... Arguments>
cudaError_t counted_launch(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchOutOfResources : cudaLaunchKernel(arguments...);
}
template <class... Arguments>
cudaError_t counted_cluster_launch(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchOutOfResources : cudaLaunchKernelExC(arguments...);
}
template <class... Arguments>
cudaError_t counted_look(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaPointerGetAttributes(arguments...);
}
template <class... Arguments>
cudaError_t counted_copy(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaMemcpyAsync(arguments...);
}
template <class... Arguments>
cudaError_t counted_fill(Arguments... arguments) {
  return work.fails() ? cudaErrorLaunchFailure : cudaMemsetAsync(arguments...);
}
/// It waits even so: on a device that has failed nothing runs any more.
inline cudaError_t counted_wait(cudaStream_t stream) {
  const cudaError_t status = cudaStreamSynchronize(stream);
  return work.fails() ? cudaErrorLaunchFailure : status;
}

/// Not counted: how often it is asked depends on the clock.
inline cudaError_t query_of_lost(cudaStream_t stream) {
  return work.failed && work.for_ever ? cudaErrorLaunchFailure : cudaStreamQuery(stream);
}

template <failing_calls& Calls, bool ForEver>
struct failure_of {
  explicit failure_of(long n) { Calls = {n, ForEver}; }
  failure_of(const failure_of&) = delete;
  failure_of& operator=(const failure_of&) = delete;
  ~failure_of() {
    Calls = {};
    cudaDeviceSynchronize();  // what was launched before has pins until it is done
  }
};

}  // namespace turbomap_test

// What the library calls again and again, here and in Thrust. Streams, events and attributes of kernels and devices are left
// alone.
#define cudaMalloc(memory, bytes) turbomap_test::counted_malloc(memory, bytes)
#define cudaMallocHost(memory, bytes) turbomap_test::counted_malloc_host(memory, bytes)
#define cudaLaunchKernel(...) turbomap_test::counted_launch(__VA_ARGS__)
#define cudaLaunchKernelExC(...) turbomap_test::counted_cluster_launch(__VA_ARGS__)
#define cudaPointerGetAttributes(...) turbomap_test::counted_look(__VA_ARGS__)
#define cudaStreamQuery(stream) turbomap_test::query_of_lost(stream)
#define cudaMemcpyAsync(...) turbomap_test::counted_copy(__VA_ARGS__)
#define cudaMemsetAsync(...) turbomap_test::counted_fill(__VA_ARGS__)
#define cudaStreamSynchronize(stream) turbomap_test::counted_wait(stream)

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

}  // namespace
