// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The loop of local mapping on a device: the map that the host makes, and true to the landmarks.

#include <thrust/system/cuda/execution_policy.h>

#include "local_mapper_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("the same map as under thrust::seq, sound after every keyframe") {
  const stream on;
  mapping_recipe back = noisy(5);
  back.turn_back = 6;
  check_same_map(on.policy(), stereo_case(back), 12, false);
  check_same_map(on.policy(), rig_case(noisy(6)), 9, false);
  check_same_map(on.policy(), monocular_case(noisy(7)), 9, false);
  auto serial = stereo_case(noisy(8));
  serial.options.fusion.mode = turbomap::fusion_mode::serial_exact;
  check_same_map(on.policy(), serial, 6, false);
}

TEST_CASE("decisions, to be compared with those of other compilers, and results with those of other architectures") {
  const stream on;
  CHECK(print_decisions(on.policy()) == print_decisions(sequential_policy{}));
  // What is computed of points: the same bits for whatever architecture this is compiled. See tests/same_architectures.sh.
  const auto stereo = decisions(on.policy(), stereo_case(noisy(5)), 14, true);
  const auto rig = decisions(on.policy(), rig_case(noisy(6)), 9, true);
  std::printf("turbomap-device-bits stereo %016llx\n", static_cast<unsigned long long>(stereo));
  std::printf("turbomap-device-bits fisheye-rig %016llx\n", static_cast<unsigned long long>(rig));
}

TEST_CASE("without noise the map is right") {
  const stream on;
  check_perfect(quality_of(on.policy(), stereo_case(), 14), 150);
  check_perfect(quality_of(on.policy(), rig_case(), 10), 200);
}

}  // namespace
