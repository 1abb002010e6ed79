// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The loop of local mapping under every host policy: the same map to the last bit, whatever the compiler may fuse, and
/// true to the landmarks. Continuous integration compiles it for several processors, and compares the digests of decisions that
/// it prints, which must not depend on compiler or processor.

#include "local_mapper_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE_TEMPLATE("the same map under every policy, sound after every keyframe", Policy, TURBOMAP_TEST_POLICIES) {
  mapping_recipe back = noisy(5);
  back.turn_back = 6;
  check_same_map(Policy{}, stereo_case(back), 12);
  check_same_map(Policy{}, rig_case(noisy(6)), 9);
  check_same_map(Policy{}, monocular_case(noisy(7)), 9);
  auto serial = stereo_case(noisy(8));
  serial.options.fusion.mode = turbomap::fusion_mode::serial_exact;
  check_same_map(Policy{}, serial, 6);
  auto pairs = rig_case(noisy(9));
  pairs.options.creation.rule = turbomap::creation_rule::pairs;
  check_same_map(Policy{}, pairs, 6);
}

TEST_CASE("decisions, to be compared with those of other compilers and processors") {
  print_decisions(sequential_policy{});
  const auto expected = print_adjusted_decisions(sequential_policy{});
#if defined(TURBOMAP_WITH_OPENMP)
  CHECK(print_adjusted_decisions(omp_policy{}) == expected);
#endif
#if defined(TURBOMAP_WITH_TBB)
  CHECK(print_adjusted_decisions(tbb_policy{}) == expected);
#endif
}

TEST_CASE_TEMPLATE("without noise the map is right", Policy, TURBOMAP_TEST_POLICIES) {
  check_perfect(quality_of(Policy{}, stereo_case(), 14), 150);
  check_perfect(quality_of(Policy{}, rig_case(), 10), 200);
  check_perfect(quality_of(Policy{}, monocular_case(), 14), 1);
  auto serial = stereo_case();
  serial.options.fusion.mode = turbomap::fusion_mode::serial_exact;
  check_perfect(quality_of(Policy{}, serial, 10), 100);
}

}  // namespace
