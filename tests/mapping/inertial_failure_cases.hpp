// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes with an IMU are mapped while the n-th allocation fails, for every n, or what else a test lets fail: an exception, a
/// sound map, nothing pinned, and the next call does the work. See no_memory_cases.hpp for mappers without an IMU.

#include <new>

#include "inertial_mapper_cases.hpp"
#include "support/fail_everywhere.hpp"

namespace turbomap_test {

/// From the ninth keyframe on calls fail; the IMU is initialised at the eleventh. Keyframes are culled, and motions bridged.
/// \param keyframes  20 or more
/// \param Failure    made with n: call n fails from then on, until it is destroyed
/// \tparam Error     what is thrown then
/// \return calls of process() that failed
template <class Failure, class Error = std::bad_alloc, class Methods = turbomap::adjustment_methods<>, class Policy>
int map_inertial_with_failures(const Policy& policy, int keyframes) {
  const mapping_recipe recipe = noisy_recipe();
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  inertial_mapping<mapped_inertial, Policy, Methods> run(scene, culled_inertial_options(recipe), {}, policy);
  run.map.set_gravity(motion.gravity);
  int failed = 0, inertial = 0;
  for (int n = 0; n < keyframes; ++n) {
    CAPTURE(n);
    const auto k = track(run, motion);
    run.map.set_initialised(n >= 10);
    const auto process = [&] { run.mapper.process(k); };
    if (n >= 8)
      failed += fail_everywhere<Failure, Error>(process, [&] {
        REQUIRE(turbomap::validate(run.map).empty());
        REQUIRE(run.store.statistics().pinned_sets == 0);
      });
    else
      process();
    const auto& report = run.mapper.report();
    CHECK(report.refused.empty());
    inertial += report.adjustment.inertial ? 1 : 0;
  }
  CHECK(inertial == keyframes - 10);
  CHECK(run.map.keyframe_count() + 2 < run.keyframes().size());
  for (std::size_t i = 1; i < run.keyframes().size(); ++i)
    if (run.map.alive(run.keyframes()[i])) CHECK(run.map.motion(run.keyframes()[i]) != nullptr);
  return failed;
}

}  // namespace turbomap_test
