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

#include "local_mapper_cases.hpp"
#include "support/fail_everywhere.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::mapping_stage;
using turbomap::stage_outcome;
using map_type = mapped_by<pinhole_camera>;
using device_run = mapping_run<map_type, stream_policy, turbomap::local_adjustment<map_type, stream_policy>>;

TEST_CASE("every allocation of device memory may fail") {
  const stream on;
  mapping_recipe small = noisy(2);
  small.per_metre = 8, small.clutter = 5;
  auto c = stereo_case(small);
  c.options.neighbours.neighbourhood.min_shared_points = 5;
  c.options.adjustment.min_shared_points = 5;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  turbomap::keyframe_store_options store;
  store.chunk_bytes = std::size_t{1} << 16, store.byte_budget = std::size_t{20} << 16;
  device_run run(scene, c.options, {}, on.policy(), store);
  run.notes_creation = false;
  int inserting = 0, processing = 0;
  std::size_t adjusted = 0;
  for (int n = 0; n < 10; ++n) {
    CAPTURE(n);
    const auto k = run.add();
    const auto& view = run.view(run.keyframes().size() - 1);
    const std::size_t stored = run.store.size();
    const auto data = scene.data<turbomap::binary_descriptor<256>>(view);
    inserting += fail_everywhere<no_device_memory_after>([&] { run.mapper.insert(k, data); },
                                                         [&] {
                                                           REQUIRE(run.store.size() == stored);
                                                           REQUIRE(run.mapper.stored().size() == stored);
                                                         });
    REQUIRE(run.store.size() == stored + 1);
    run.associate(k, view);
    processing += fail_everywhere<no_device_memory_after>([&] { run.mapper.process(k); },
                                                          [&] {
                                                            REQUIRE(turbomap::validate(run.map).empty());
                                                            REQUIRE(run.store.size() == run.mapper.stored().size());
                                                            REQUIRE(run.store.statistics().pinned_sets == 0);
                                                          });
    const auto& report = run.mapper.report();
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) CHECK(report.outcome.values[s] == stage_outcome::done);
    CHECK(report.refused.empty());
    adjusted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    run.note();
  }
  CHECK(cudaGetLastError() == cudaSuccess);  // no error is left behind for somebody else's next call
  CHECK(inserting > 2);
  CHECK(processing > 20);
  CHECK(adjusted > 5);
  CHECK(run.quality().points > 50);
  CHECK(turbomap::validate(run.map).empty());
  CHECK(run.quality().merged_wrongly == 0);
}

}  // namespace
