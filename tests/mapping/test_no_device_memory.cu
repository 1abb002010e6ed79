// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The n-th allocation of device or pinned memory fails, for every n, while keyframes are inserted and mapped on a device: an
// exception, a sound map, a store as it was, nothing pinned, and the next call does the work.

#include <cuda_runtime.h>

namespace turbomap_test {

inline long device_allocations_left = -1;  ///< until they fail; below 0: never

inline bool no_device_memory() {
  if (device_allocations_left <= 0) return device_allocations_left == 0;
  --device_allocations_left;
  return false;
}
inline cudaError_t counted_malloc(void** memory, std::size_t bytes) {
  return no_device_memory() ? cudaErrorMemoryAllocation : cudaMalloc(memory, bytes);
}
inline cudaError_t counted_malloc_host(void** memory, std::size_t bytes) {
  return no_device_memory() ? cudaErrorMemoryAllocation : cudaMallocHost(memory, bytes);
}

struct no_device_memory_after {
  explicit no_device_memory_after(long n) { device_allocations_left = n; }
  no_device_memory_after(const no_device_memory_after&) = delete;
  no_device_memory_after& operator=(const no_device_memory_after&) = delete;
  ~no_device_memory_after() { device_allocations_left = -1; }
};

}  // namespace turbomap_test

// The library asks for memory of a device in these two places, turbomap/cuda/memory.cuh.
#define cudaMalloc(memory, bytes) turbomap_test::counted_malloc(memory, bytes)
#define cudaMallocHost(memory, bytes) turbomap_test::counted_malloc_host(memory, bytes)

#include <thrust/system/cuda/execution_policy.h>

#include "no_memory_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using map_type = mapped_by<pinhole_camera>;
using device_run = mapping_run<map_type, stream_policy, turbomap::local_adjustment<map_type, stream_policy>>;

TEST_CASE("every allocation of device memory may fail") {
  const stream on;
  const auto c = case_of_failures();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  device_run run(scene, c.options, {}, on.policy(), store_of_failures());
  const failures_met met = map_with_failures<no_device_memory_after>(run, scene, 10);
  CHECK(cudaGetLastError() == cudaSuccess);  // no error is left behind for somebody else's next call
  CHECK(met.inserting > 2);
  CHECK(met.processing > 20);
  CHECK(met.adjusted > 5);
  CHECK(run.quality().points > 50);
}

}  // namespace
