// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The loop of local mapping under every host policy: the same map to the last bit, whatever the compiler may fuse, and
/// true to the landmarks. Continuous integration compiles it for several processors, and compares the digests of decisions that
/// it prints, which must not depend on compiler or processor.

#include <cstdio>

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

/// All integers of a run whose inputs do not depend on the compiler: what each stage counted, and names, octaves, descriptors
/// and observations of the map after each keyframe. Poses stay as they were given: no adjustment.
template <class Camera>
std::uint64_t decisions(mapping_case<Camera> c, int keyframes) {
  c.recipe.rounded = true;
  const mapping_scene<Camera> scene(c.rig, c.recipe);
  mapping_run<mapped_by<Camera>, sequential_policy> run(scene, c.options);
  std::uint64_t digest = 14695981039346656037U;  // FNV-1a
  const auto add = [&digest](const void* data, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i)
      digest = (digest ^ static_cast<const unsigned char*>(data)[i]) * 1099511628211U;
  };
  for (int n = 0; n < keyframes; ++n) {
    const auto counted = counts(run.step());
    const std::string map = content(run.map, false);
    add(counted.data(), counted.size() * sizeof counted[0]), add(map.data(), map.size());
  }
  CHECK(run.quality().points > 100);
  return digest;
}

TEST_CASE("decisions, to be compared with those of other compilers and processors") {
  mapping_recipe back = noisy(5);
  back.turn_back = 6;
  auto pairs = rig_case(noisy(9));
  pairs.options.creation.rule = turbomap::creation_rule::pairs;
  std::printf("turbomap-digest stereo-decisions %016llx\n",
              static_cast<unsigned long long>(decisions(stereo_case(back), 14)));
  std::printf("turbomap-digest fisheye-rig-decisions %016llx\n",
              static_cast<unsigned long long>(decisions(rig_case(noisy(6)), 9)));
  std::printf("turbomap-digest fisheye-rig-pairs-decisions %016llx\n",
              static_cast<unsigned long long>(decisions(pairs, 9)));
  std::printf("turbomap-digest mono-decisions %016llx\n",
              static_cast<unsigned long long>(decisions(monocular_case(noisy(7)), 12)));
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
