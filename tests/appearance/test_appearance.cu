// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The update of map points on a device: the oracle's answer, and that of the host to the last bit.

#include <thrust/system/cuda/execution_policy.h>

#include "appearance_cases.hpp"
#include "support/stream.cuh"

namespace turbomap_test {

/// 256 bits that the device reads 16 bytes at once.
struct wide_words {
  using element = std::uint64_t;
  static constexpr int elements = 4, bytes = 32;
  using distance_type = std::int32_t;
  static constexpr distance_type worst = std::numeric_limits<std::int32_t>::max();
  static TURBOMAP_HD distance_type distance(const element* a, const element* b) {
    std::int32_t sum = 0;
#if defined(__CUDA_ARCH__)
    for (int i = 0; i < elements / 2; ++i) {
      const ulonglong2 x = reinterpret_cast<const ulonglong2*>(a)[i], y = reinterpret_cast<const ulonglong2*>(b)[i];
      sum += __popcll(x.x ^ y.x) + __popcll(x.y ^ y.y);
    }
#else
    for (int i = 0; i < elements; ++i) sum += __builtin_popcountll(a[i] ^ b[i]);
#endif
    return sum;
  }
};

}  // namespace turbomap_test

namespace {

using namespace turbomap_test;
using turbomap::real_descriptor;
using cuda = std::decay_t<decltype(thrust::cuda::par)>;

TEST_CASE("points of pinhole keyframes") {
  const stream on;
  unsigned seed = 1;
  for (const motion how : {motion::sideways, motion::forward, motion::turn_at_origin, motion::anything})
    check_update<stream_policy, orb_bits>(on.policy(), pinhole_rig(50), seed++, how);
  check_update<stream_policy, orb_bits>(on.policy(), pinhole_rig(), 11, motion::anything, 3, 2.0F);
}
TEST_CASE("points of fisheye and mixed rigs") {
  const stream on;
  check_update<stream_policy, orb_bits>(on.policy(), fisheye_rig(), 21, motion::anything);
  check_update<stream_policy, orb_bits>(on.policy(), fisheye_rig(3), 22);
  check_update<stream_policy, orb_bits>(on.policy(), mixed_rig(), 23, motion::anything);
}
TEST_CASE("other descriptors") {
  const stream on;
  check_update<stream_policy, turbomap::binary_descriptor<488>>(on.policy(), pinhole_rig(), 31);
  check_update<stream_policy, real_descriptor<float, 64>>(on.policy(), pinhole_rig(), 32);
  check_update<stream_policy, real_descriptor<std::int8_t, 24>>(on.policy(), fisheye_rig(), 33);
}
TEST_CASE("more views than lanes, and than the shared memory of a block holds") {
  const stream on;
  const std::vector<int> counts{31, 32, 33, 0, 127, 128, 129, 255, 256, 257, 1, 350, 700};
  check_many_views<stream_policy, orb_bits>(on.policy(), pinhole_rig(), counts);
  check_many_views<stream_policy, turbomap::binary_descriptor<488>>(on.policy(), fisheye_rig(), counts);
  check_many_views<stream_policy, real_descriptor<float, 64>>(on.policy(), pinhole_rig(), counts);
  check_many_views<stream_policy, real_descriptor<std::int8_t, 24>>(on.policy(), pinhole_rig(), counts);
}
TEST_CASE("a user's descriptors of wide elements") {
  const stream on;
  check_update<stream_policy, wide_words>(on.policy(), pinhole_rig(), 34);
  check_many_views<stream_policy, wide_words>(on.policy(), pinhole_rig(), {3, 33, 129, 257, 350});
}
TEST_CASE("points that need no oracle") { check_known_points<cuda>(); }
TEST_CASE("nothing to update") { check_empty_updates<cuda>(); }
TEST_CASE("descriptors that are no numbers") { check_descriptors_of_nan<cuda>(); }
TEST_CASE("arguments") { check_update_arguments<cuda>(); }
TEST_CASE("memory") { check_update_allocations<cuda>(turbomap::default_resource(turbomap::device_memory{})); }

}  // namespace
