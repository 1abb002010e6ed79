// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The search by projection on a device: the oracle's answer, and that of the host to the last bit.

#include <turbomap/descriptor/real.hpp>

#include <thrust/system/cuda/execution_policy.h>

#include <array>

#include "projection_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;

TEST_CASE("pinhole frames") {
  const stream on;
  const auto t = check_projection_scenes(on.policy(), std::vector{pinhole_rig(50)}, crowded(10), wide());
  check_duplicate_tally(t, 10, 0.01);
  CHECK(t.outcomes[static_cast<std::size_t>(projection_outcome::lost)] > 20);
}
TEST_CASE("fisheye rigs of one to three cameras") {
  const stream on;
  check_duplicate_tally(check_projection_scenes(on.policy(), fisheye_rigs(), crowded(30), wide()), 10, 0.01);
}
TEST_CASE("gate and ratio, points that are not exact, real descriptors, little to do") {
  const stream on;
  projection_options options = wide();
  options.gate = turbomap::projection_gate::all, options.max_ratio = 0.8;
  CHECK(check_projection_scenes(on.policy(), std::vector{pinhole_rig(50)}, crowded(60), options).differences == 0);
  options = wide(), options.max_distance = 2;
  CHECK(check_projection_scenes<turbomap::real_descriptor<float, 64>>(on.policy(), std::vector{pinhole_rig(50)},
                                                                      crowded(50), options)
            .differences == 0);
  duplicate_recipe uncertain = crowded(200);
  uncertain.uncertain = 0.7, uncertain.not_finite = 0.2;
  check_duplicate_tally(check_projection_scenes(on.policy(), std::vector{mixed_rig()}, uncertain, {}), 5, 0.01);
  for (const auto& [targets, points, clutter] :
       {std::array<int, 3>{0, 0, 0}, std::array<int, 3>{1, 1, 0}, std::array<int, 3>{1, 65, 0}}) {
    duplicate_recipe recipe = crowded(100);
    recipe.targets = targets, recipe.points = points, recipe.clutter = clutter;
    CHECK(check_projection_scenes(on.policy(), std::vector{pinhole_rig(50)}, recipe, wide()).differences == 0);
  }
}

}  // namespace
