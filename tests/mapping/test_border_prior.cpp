// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Windows that slide over a map with a marginal prior of the keyframe before them: they keep the optimum of all keyframes, and come
// near to it where they meet the keyframes one after the other.

#include <doctest/doctest.h>

#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "border_prior_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using sequential_run = inertial_run<sequential>;

TEST_CASE_TEMPLATE("linearised at the optimum of all keyframes and landmarks, the prior keeps that optimum", Policy,
                   TURBOMAP_TEST_POLICIES) {
  check_keeps_optimum(Policy{});
}

TEST_CASE_TEMPLATE("the prior keeps that optimum in mixed precision", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  check_keeps_optimum(Policy{}, {5}, to_the_end_in_mixed_precision());
}

TEST_CASE("windows that meet the keyframes one after the other: nearer to the optimum of all, and to the truth") {
  double from_optimum[2] = {}, from_truth[2] = {};  // without, with
  for (unsigned seed = 1; seed < 7; ++seed) {
    inertial_recipe recipe;
    recipe.seed = seed, recipe.keyframes = 24;
    inertial_map_scene batch(recipe);
    sequential_run all(sequential{}, batch);
    adjust_all(all, false);
    for (const bool prior : {true, false}) {
      inertial_map_scene scene(recipe);
      sequential_run run(sequential{}, scene);
      for (int current = 3; current < 24; ++current) run(current, to_the_end(), windows(4, prior));
      CHECK(turbomap::validate(scene.map).empty());
      const double d = apart(scene, batch, 20, 24), e = scene.velocity_error(20, 24);
      from_optimum[prior] += d * d, from_truth[prior] += e * e;
    }
  }
  MESSAGE("with the prior over without: " << std::sqrt(from_optimum[true] / from_optimum[false])
                                          << " from the optimum, " << std::sqrt(from_truth[true] / from_truth[false])
                                          << " of velocities from the truth");
  CHECK(from_optimum[true] < 0.5 * from_optimum[false]);
  CHECK(from_truth[true] < 0.5 * from_truth[false]);
}

/// Whether the oldest keyframe of a window that ends at `current` moves: something is known of it.
template <class Run>
bool is_known(Run& run, int current, int keyframes) {
  const auto summary = run(current, to_the_end(), windows(keyframes, true));
  return summary.free_keyframes == static_cast<std::size_t>(keyframes) + 1;
}

TEST_CASE("what is known of the keyframe before a window, and what is not") {
  inertial_map_scene scene;
  sequential_run run(sequential{}, scene);
  CHECK_FALSE(is_known(run, 5, 3));  // the first window: nothing was adjusted before it
  CHECK(is_known(run, 6, 3));
  CHECK(is_known(run, 6, 3));         // the same window again
  CHECK(is_known(run, 9, 3));         // two windows were skipped: keyframe 6 was in the last one
  CHECK_FALSE(is_known(run, 13, 3));  // keyframe 10 was in none

  SUBCASE("somebody moved it") {
    const auto k = scene.keyframes[11];
    auto T = scene.map.T_cw(k);
    T.tx += 1e-3;
    scene.map.set_pose(k, T);
    CHECK_FALSE(is_known(run, 13, 2));
  }
  SUBCASE("nobody did") { CHECK(is_known(run, 13, 2)); }
  SUBCASE("somebody told it another velocity") {
    const auto k = scene.keyframes[11];
    scene.map.set_velocity(k, scene.map.velocity(k) + vec3<double>{1e-3, 0, 0});
    CHECK_FALSE(is_known(run, 13, 2));
  }
  SUBCASE("gravity is another") {
    scene.map.set_gravity(scene.map.gravity() + vec3<double>{0.01, 0, 0});
    CHECK_FALSE(is_known(run, 13, 2));
  }
  SUBCASE("the keyframes that left the window are erased: what they knew stays") {
    run(13, to_the_end(), windows(5, true));
    for (std::size_t f = 0; f < 10; ++f) turbomap::erase_keyframe(scene.map, scene.keyframes[f]);
    CHECK(is_known(run, 13, 3));
  }
  SUBCASE("forgotten, and where the option was off in between") {
    run(13, to_the_end(), windows(4, true));
    CHECK(is_known(run, 13, 3));
    run.adjust.forget();
    CHECK_FALSE(is_known(run, 13, 3));
    run(13, to_the_end(), windows(4, true));
    run(13, to_the_end(), windows(4, false));
    CHECK_FALSE(is_known(run, 13, 3));
  }
  SUBCASE("nothing is known beyond a hole in the chain") {
    scene.map.clear_motion(scene.keyframes[11]);
    run(13, to_the_end(), windows(4, true));
    SUBCASE("where it ends") { CHECK_FALSE(is_known(run, 13, 2)); }
    SUBCASE("behind it") { CHECK_FALSE(is_known(run, 13, 1)); }
    SUBCASE("from the next window on") {
      disturb(scene, 2);  // there is something to adjust, and to keep
      CHECK_FALSE(is_known(run, 13, 2));
      CHECK(is_known(run, 13, 1));
    }
  }
  SUBCASE("where the map begins, its first keyframe keeps the gauge") {
    const auto pose = scene.map.T_cw(scene.keyframes[0]);
    run(4, to_the_end(), windows(8, true));
    CHECK(is_known(run, 4, 4));
    CHECK(scene.map.T_cw(scene.keyframes[0]).tx == pose.tx);
    CHECK(is_known(run, 5, 4));
  }
}

TEST_CASE("a chain that began anew is held by its oldest keyframe once those that held it are gone") {
  inertial_recipe recipe{14, 30, 1};
  recipe.step_ns = 20'000'000;  // they see the same points
  recipe.begins_anew = 6;
  inertial_map_scene scene(recipe);
  sequential_run run(sequential{}, scene);
  const auto oldest = scene.keyframes[6];
  const auto first = scene.map.T_cw(oldest);
  REQUIRE(run(9, to_the_end(), windows(4, true)).solve.accepted > 0);
  const auto held_by_others = scene.map.T_cw(oldest);
  CHECK_FALSE(turbomap::is_same_pose(held_by_others, first));
  bool alone = false;
  SUBCASE("they are there") {}
  SUBCASE("they are gone") {
    alone = true;
    for (const std::size_t f : {0, 1, 2, 3, 4, 5, 11, 12, 13}) turbomap::erase_keyframe(scene.map, scene.keyframes[f]);
  }
  const auto summary = run(10, to_the_end(), windows(4, true));
  REQUIRE(summary.solve.accepted > 0);
  CHECK((summary.fixed_keyframes == 0) == alone);
  CHECK(turbomap::is_same_pose(scene.map.T_cw(oldest), held_by_others) == alone);
}

}  // namespace
