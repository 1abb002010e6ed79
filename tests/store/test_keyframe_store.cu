// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The tests of the keyframe store in device memory, and what only a device can get wrong: work that is still reading.

#include <thrust/system/cuda/execution_policy.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

#include "keyframe_large_cases.hpp"
#include "keyframe_paging_cases.hpp"

namespace {

using namespace turbomap_test;
using cuda = std::decay_t<decltype(thrust::cuda::par)>;
using on_stream = std::decay_t<decltype(thrust::cuda::par_nosync.on(cudaStream_t{}))>;

TEST_CASE("ten thousand keyframes are inserted, erased and inserted again") { check_ten_thousand<cuda>(); }
TEST_CASE("keyframes of 1200 keypoints") { check_realistic<cuda>(); }
TEST_CASE("stale handles are refused and nothing is pinned") { check_stale_handles<cuda>(); }
TEST_CASE("an erased keyframe stays until its readers are done") { check_deferred_reclamation<cuda>(); }
TEST_CASE("beyond the budget the least recently used are paged out") { check_paging<cuda>(); }
TEST_CASE("a keyframe larger than a chunk takes the place of many") { check_large_keyframe<cuda>(); }
TEST_CASE("a failing allocation leaves the store as it was") { check_failing_allocations<cuda>(); }
TEST_CASE("random operations") { check_random_operations<cuda>(5000); }

/// Holds a stream up until the host says go.
struct gate {
  std::atomic<bool> open{false};
  static void CUDART_CB wait(void* self) {
    while (!static_cast<gate*>(self)->open) {
    }
  }
};

/// A stream that is destroyed with its test.
struct stream {
  cudaStream_t handle = nullptr;
  stream() { turbomap::check_cuda(cudaStreamCreateWithFlags(&handle, cudaStreamNonBlocking), "creation of a stream"); }
  ~stream() { cudaStreamDestroy(handle); }
};

TEST_CASE("memory of an erased keyframe is not used again before the stream that reads it has passed") {
  const auto a = make_keyframe(1, 300), b = make_keyframe(2, 300);
  const auto expected = packed(a);
  stream s;
  turbomap::context<on_stream> ctx{thrust::cuda::par_nosync.on(s.handle)};
  sample_store<cuda> store;
  gate held;
  std::byte* copy = nullptr;
  turbomap::check_cuda(cudaMallocHost(&copy, expected.size()), "pinned memory");
  const auto handle = store.insert(a.data());
  turbomap::check_cuda(cudaLaunchHostFunc(s.handle, gate::wait, &held), "host function");
  {
    const auto pinned = store.pin(ctx, handles{handle});
    turbomap::copy_out(ctx.policy(), copy, pinned[0].pixel, expected.size());
  }  // released behind the copy, which has not begun
  store.erase(handle);
  for (int i = 0; i < 20; ++i) CHECK(store.insert(b.data()).slot != handle.slot);  // does not wait for the stream
  CHECK(store.statistics().pinned_sets == 1);
  CHECK(store.statistics().resident_blocks == 21);
  held.open = true;
  ctx.synchronize();
  CHECK(std::equal(expected.begin(), expected.end(), copy));
  CHECK(store.statistics().pinned_sets == 0);
  CHECK(store.statistics().resident_blocks == 20);
  CHECK(store.insert(b.data()).slot == handle.slot);
  cudaFreeHost(copy);
}

TEST_CASE("a thread that has another device inserts into the store's, and keeps its own") {
  int devices = 0;
  turbomap::check_cuda(cudaGetDeviceCount(&devices), "count of the devices");
  if (devices < 2) {
    MESSAGE("skipped: one device only");
    return;
  }
  const auto k = make_keyframe(1, 300);
  const auto expected = packed(k);
  turbomap::check_cuda(cudaSetDevice(1), "choice of a device");
  {
    sample_store<cuda> store;
    turbomap::keyframe_handle handle{};
    int device_after = -1;
    std::thread tracking([&] {  // a new thread has device 0
      handle = store.insert(k.data());
      cudaGetDevice(&device_after);
    });
    tracking.join();
    CHECK(device_after == 0);
    turbomap::context<cuda> ctx;
    const auto pinned = store.pin(ctx, handles{handle});
    cudaPointerAttributes where{};
    turbomap::check_cuda(cudaPointerGetAttributes(&where, pinned[0].pixel), "attributes of memory");
    CHECK(where.device == 1);
    std::vector<std::byte> copy(expected.size());
    turbomap::copy_out(ctx.policy(), copy.data(), pinned[0].pixel, expected.size());
    ctx.synchronize();
    CHECK(std::equal(expected.begin(), expected.end(), copy.data()));
  }
  turbomap::check_cuda(cudaSetDevice(0), "choice of a device");
}

TEST_CASE("without room, the store waits for work that is under way rather than giving up") {
  std::vector<sample_keyframe> frames;
  for (unsigned i = 0; i < 6; ++i) frames.push_back(make_keyframe(i, 200));
  stream s;
  turbomap::context<on_stream> ctx{thrust::cuda::par_nosync.on(s.handle)};
  sample_store<cuda> store(room_for(2, make_keyframe(0, 200)));
  handles all;
  for (const auto& k : frames) all.push_back(store.insert(k.data()));
  for (int round = 0; round < 50; ++round) {
    const std::size_t i = static_cast<std::size_t>(round) % 6;
    const auto expected = packed(frames[i]);
    std::vector<std::byte> seen(expected.size());
    auto pinned = store.pin(ctx, handles{all[i]});
    turbomap::copy_out(ctx.policy(), seen.data(), pinned[0].pixel, expected.size());
    pinned.release_after(ctx);
    ctx.synchronize();
    CHECK(seen == expected);
  }
}

}  // namespace
