// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The context in device memory: loops, copies, scratch, uploads, memory of the user's own, and running out of it.

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include "context_cases.hpp"
#include "scenes/keyframe_samples.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using cuda = std::decay_t<decltype(thrust::cuda::par)>;
using cuda_nosync = std::decay_t<decltype(thrust::cuda::par_nosync)>;

template <class Policy>
void check_all(const Policy& policy) {
  static_assert(std::is_same_v<turbomap::memory_of_t<Policy>, turbomap::device_memory>);
  check_parallel(policy);
  check_scratch(policy);
  check_upload(policy);
  check_packed_inputs(policy);
}

TEST_CASE("every CUDA policy") {
  check_all(cuda{});
  check_all(cuda_nosync{});
  const stream on;
  check_all(on.policy());
}
TEST_CASE("thrust::device computes on the device, thrust::host and thrust::seq on the host") {
  turbomap::context device{thrust::device};
  static_assert(std::is_same_v<decltype(device)::memory_type, turbomap::device_memory>);
  check_parallel(thrust::device);
  check_parallel(thrust::host);
  check_parallel(thrust::seq);
}

TEST_CASE("the stream of a policy is the one it was made with") {
  const stream on;
  CHECK(turbomap::stream_of(on.policy()) == on.handle());
}

TEST_CASE("device and pinned memory come from the user's resources, and nothing in the steady state") {
  const stream on;
  counting_resource resident(turbomap::default_resource(turbomap::device_memory{}));
  counting_resource staging(turbomap::default_staging_resource(turbomap::device_memory{}));
  {
    turbomap::context<stream_policy> ctx(on.policy(), &resident, &staging);
    turbomap::array<std::byte, turbomap::device_memory> target(&resident);
    long before = 0;
    for (int round = 0; round < 6; ++round) {
      ctx.begin_call();
      turbomap::fill_bytes(ctx.policy(), ctx.scratch<char>(1000), 1, 1000);
      turbomap::fill_bytes(ctx.policy(), ctx.scratch<char>(200000), 2, 200000);
      auto block = ctx.begin_upload(target, 5000);
      std::memset(block.host, round, 5000);
      ctx.send(block, 5000);
      if (round == 3) before = resident.allocations + staging.allocations;
    }
    CHECK(resident.allocations + staging.allocations == before);
    CHECK(resident.allocations > 0);
    CHECK(staging.allocations == 1);
    ctx.synchronize();
  }
  CHECK(resident.bytes_out == 0);
  CHECK(staging.bytes_out == 0);
}

TEST_CASE("more memory than there is: an exception, and the device works on") {
  turbomap::context<cuda> ctx{};
  turbomap::array<char, turbomap::device_memory> a;
  CHECK_THROWS_AS(a.resize_discard(std::size_t{1} << 50), turbomap::out_of_memory);
  CHECK_THROWS_AS(ctx.scratch<char>(std::size_t{1} << 50), turbomap::out_of_memory);
  CHECK(cudaGetLastError() == cudaSuccess);
  check_parallel(cuda{});
}

struct nothing {  // a lambda for devices would need an option of nvcc that users do not give
  __device__ void operator()(int) const {}
};

TEST_CASE("a failed call of the run-time says which") {
  CHECK_NOTHROW(turbomap::check_cuda(cudaSuccess, "nothing"));
  CHECK_THROWS_AS(turbomap::check_cuda(cudaErrorInvalidValue, "a copy"), turbomap::device_error);
  CHECK_THROWS_AS(
      turbomap::launch_kernel(cuda{}, "a launch", turbomap::for_each_index_kernel<nothing>, 1, 4096, 1, nothing{}),
      turbomap::device_error);
  CHECK(cudaGetLastError() == cudaSuccess);  // it has been answered
}

}  // namespace
