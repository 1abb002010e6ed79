// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The n-th allocation fails, for every n, while a keyframe is inserted and mapped with everything on: the map is sound, the
/// store holds what the mapper knows, nothing stays pinned, and the next call does the work. The same of a mapper with an IMU, of
/// its initialisation, and of what loop closing calls. See test_local_mapper.cpp for a mapper that is new, and without adjustment.

#include <thrust/execution_policy.h>

#include <cstddef>
#include <vector>

#include <turbomap/mapping/mirror_points.hpp>

#include "inertial_failure_cases.hpp"
#include "no_memory_cases.hpp"
#include "scenes/mirrored_map.hpp"
#include "scenes/pointer_map.hpp"
#include "support/counted_new.hpp"

namespace {

using namespace turbomap_test;
using flat = mapped_by<pinhole_camera>;
using mirrored_flat = mirrored_map<flat>;  // and mirrored all the same
template <class Map>
using adjusted_run = mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>>;

template <class Map, class Failure>
void check_insert_and_process() {
  auto c = case_of_failures();
  c.options.covariances = true;
  c.options.checked_share = 1;          // of a mirror
  c.options.points_read_per_guard = 8;  // keyframes are culled in parts
  c.options.keyframe_culling.redundant_share = 0.5F, c.options.keyframe_culling.observers = 1;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run<Map> run(scene, c.options, {}, sequential_policy(), store_of_failures());
  const failures_met met = map_with_failures<Failure>(run, scene, 14);
  CHECK(met.inserting > 10);
  CHECK(met.processing > 100);
  CHECK(met.adjusted > 8);
  CHECK(run.map.keyframe_count() < 12);  // culled
}

TEST_CASE_TEMPLATE("every allocation of insert and process may fail, with all after it", Map, flat, mirrored_flat) {
  check_insert_and_process<Map, no_memory_after>();
}
TEST_CASE("every allocation of insert and process may fail, alone") {
  check_insert_and_process<flat, no_memory_once>();
}

TEST_CASE("every allocation of a mapper with an IMU may fail, while it culls and bridges motions") {
  CHECK(map_inertial_with_failures<no_memory_after>(sequential_policy(), 20) > 100);
}

TEST_CASE("every allocation of an initialisation may fail: the map is as it was") {
  const mapping_recipe recipe = noisy_recipe();
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  const true_motion motion{scene};
  inertial_mapping<mapped_inertial, sequential_policy> run(scene, culled_inertial_options(recipe));
  turbomap::map_keyframe_id k;
  for (int n = 0; n < 20; ++n) {
    k = track(run, motion);
    run.map.set_velocity(k, {0, 0, 0});
    run.mapper.process(k);
  }
  // Others, of which the IMU told nothing: they are scaled with the map all the same.
  const auto T_cw = run.map.T_cw(k);
  for (int n = 0; n < 50; ++n) run.map.add_keyframe({}, T_cw);
  turbomap::inertial_initialisation<mapped_inertial> initialise;
  turbomap::initialisation_options options;
  options.monocular = true;
  options.max_scale_sigma = options.max_gravity_sigma = 1;  // whatever it finds is believed
  const std::vector<double> before = numbers_of(run.map);
  const int failed = fail_everywhere<no_memory_after>([&] { initialise(run.map, k, options); },
                                                      [&] {
                                                        REQUIRE(numbers_of(run.map) == before);
                                                        REQUIRE(!run.map.initialised());
                                                      });
  CHECK(failed > 5);
  CHECK(run.map.initialised());
  CHECK(numbers_of(run.map) != before);
}

TEST_CASE("every allocation of what loop closing calls may fail") {
  auto c = case_of_failures();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run<flat> run(scene, c.options, {}, sequential_policy(), store_of_failures());
  run.steps(10);
  const closing_failures met = close_with_failures<no_memory_after>(run);
  CHECK(met.fusing > 0);
  CHECK(met.adjusting > 10);
  CHECK(met.updating > 0);
}

TEST_CASE("the room that a mirror keeps is enough for what a keyframe brings: lists do not grow under the guard") {
  using traits = turbomap::map_traits<pointer_map>;
  pointer_map map;
  turbomap::mirror_points<pointer_map> points;
  long allocated = 0;
  for (int keyframe = 0; keyframe < 20; ++keyframe) {
    std::vector<traits::point> created;
    for (int n = 0; n < 256; ++n) created.push_back(traits::add_point(map, {1, 2, 3}, {}));
    points.keep_room();
    const long before = allocations;
    for (const auto p : created) {
      const auto place = static_cast<std::size_t>(points.take(p, traits::id(map, p)));
      for (int view = 0; view < 4; ++view) points.lists.add(place, {view, 0});
    }
    allocated += allocations - before;
  }
  CHECK(points.size() == 1 + 20 * 256);
  CHECK(allocated == 0);
}

}  // namespace
