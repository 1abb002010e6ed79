// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The duplicate search on a device: the oracle's answer, and that of the host to the last bit.

#include <turbomap/descriptor/real.hpp>

#include <thrust/system/cuda/execution_policy.h>

#include <array>

#include "duplicate_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::duplicate_options;

TEST_CASE("pinhole keyframes") {
  const stream on;
  check_duplicate_tally(check_scenes(on.policy(), pinhole_rig(), seeded(10)), 5);
  duplicate_recipe large = seeded(20);
  large.targets = 12, large.points = 1200, large.clutter = 900;
  check_duplicate_tally(check_scenes(on.policy(), pinhole_rig(50), large, {}, 1), 10);
  duplicate_recipe many = seeded(25);  // so many that a block takes more points than it has threads
  many.targets = 44, many.points = 1100, many.clutter = 50;
  CHECK(check_scenes(on.policy(), pinhole_rig(50), many, {}, 1).differences == 0);
}
TEST_CASE("fisheye rigs of one to three cameras") {
  const stream on;
  check_duplicate_tally(check_scenes(on.policy(), fisheye_rigs(), seeded(30)), 5);
}
TEST_CASE("every camera model, and rigs of mixed ones") {
  const stream on;
  check_duplicate_tally(check_scenes(on.policy(), mixed_rig(), seeded(40)), 5);
  check_duplicate_tally(check_scenes(on.policy(), double_sphere_rig(), seeded(50)), 5);
  check_duplicate_tally(check_scenes(on.policy(), brown_conrady_rig(), seeded(60)), 5);
  check_duplicate_tally(check_scenes(on.policy(), equisolid_rig(), seeded(70)), 5);
}
TEST_CASE("other descriptors") {
  const stream on;
  duplicate_options options;
  options.max_distance = 1.5;
  check_duplicate_tally(
      check_scenes<turbomap::real_descriptor<float, 64>>(on.policy(), pinhole_rig(50), seeded(90), options), 5);
}
TEST_CASE("without ranges and normals, without a grid, far away, with numbers that are not finite") {
  const stream on;
  duplicate_options options;
  options.range_gate = false, options.min_view_cosine = -1, options.window_octave = 2;
  duplicate_scene<orb, pinhole_camera> s({pinhole_rig(50)}, seeded(110));
  auto points = s.points();
  points.normal = nullptr, points.min_distance = points.max_distance = nullptr;
  duplicate_tally t;
  check_duplicates(on.policy(), s, points, options, t);
  CHECK(t.differences == 0);
  CHECK(t.outcomes[0] > 10);
  duplicate_recipe recipe = seeded(120);
  recipe.columns = recipe.rows = 0, recipe.not_finite = 0.3, recipe.origin = 1e6, recipe.skip = -1;
  CHECK(check_scenes(on.policy(), fisheye_rigs(), recipe).differences == 0);
}
TEST_CASE("points on the threshold") {
  const stream on;
  duplicate_recipe recipe = seeded(150);
  recipe.on_edge = 0.7, recipe.points = 400, recipe.off_unit = 5e-4;
  check_duplicate_tally(check_scenes(on.policy(), pinhole_rig(50), recipe), 5, 0.2);
  check_duplicate_tally(check_scenes(on.policy(), fisheye_rigs(), recipe), 5, 0.2);
}
TEST_CASE("nothing to do, and very little") {
  const stream on;
  for (const auto& [targets, points, clutter] : {std::array<int, 3>{0, 0, 0}, std::array<int, 3>{3, 0, 50},
                                                 std::array<int, 3>{1, 1, 0}, std::array<int, 3>{1, 65, 0}}) {
    duplicate_recipe recipe = seeded(170);
    recipe.targets = targets, recipe.points = points, recipe.clutter = clutter;
    CHECK(check_scenes(on.policy(), pinhole_rig(50), recipe).differences == 0);
  }
}

TEST_CASE("a result is used again over its own work, and bad input is refused before anything is launched") {
  const stream on;
  duplicate_scene<orb, pinhole_camera> first({pinhole_rig(50)}, seeded(1)), second({pinhole_rig(50)}, seeded(2));
  turbomap::context<stream_policy> ctx(on.policy());
  const resident_targets<orb, pinhole_camera, stream_policy> a(ctx, first), b(ctx, second);
  turbomap::duplicates<orb, pinhole_camera, stream_policy> found(ctx);
  turbomap::find_duplicates(ctx, first.points(), a.targets(), {}, found);
  turbomap::find_duplicates(ctx, second.points(), b.targets(), {}, found);
  const auto plan = found.plan(ctx);
  CHECK(!plan.empty());
  duplicate_options options;
  options.scales = second.scales();
  CHECK(same(plan, find_under(sequential{}, second, second.points(), options).plan));
  options.radius = -1;
  CHECK_THROWS_AS(turbomap::find_duplicates(ctx, first.points(), a.targets(), options, found), std::invalid_argument);
  CHECK(same(found.plan(ctx), plan));
}

}  // namespace
