// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Mapper, tracking and loop closing on one map with an IMU, in three threads (mapper_threads_cases.hpp): velocities, biases and
/// motions are written and merged while others read them, move the map and refine the initialisation.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <turbomap/map/simple_map/simple_inertial_map.hpp>
#include <turbomap/mapping/inertial_adjustment.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cmath>
#include <cstddef>
#include <mutex>

#include "mapper_threads_cases.hpp"
#include "scenes/inertial_motion.hpp"
#include "scenes/mirrored_map.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;

struct shared_inertial_map : mapped_inertial {
  using mapped_inertial::mapped_inertial;
  mutable std::mutex mutex;
};
/// The same map, of which the mapper works on a copy.
using mirrored_shared_map = mirrored_map<shared_inertial_map>;

}  // namespace

template <>
struct turbomap::map_traits<shared_inertial_map> : turbomap::map_traits<mapped_inertial> {
  static std::unique_lock<std::mutex> guard(const shared_inertial_map& m) {
    return std::unique_lock<std::mutex>(m.mutex);
  }
};
template <>
struct turbomap::inertial_traits<shared_inertial_map> : turbomap::inertial_traits<mapped_inertial> {};

namespace {

/// Velocities and motions that the IMU gives; gravity is known from keyframe 5 on, and estimated again now and then.
template <class Map>
struct with_imu {
  true_motion motion;
  turbomap::inertial_initialisation<Map> initialise{};

  template <class Run>
  void tracked(Run& run, turbomap::map_keyframe_id k, int n) const {
    run.map.set_velocity(k, motion.velocity(n));
    if (n > 0) run.map.set_motion(k, motion.between(n - 1, n));
    if (n == 5) run.map.set_gravity(motion.gravity), run.map.set_initialised(true);
    run.map.set_refined(n > 15);
  }
  template <class Run>
  void processed(Run& run, turbomap::map_keyframe_id k, int n) {
    if (n % 8 == 7) initialise(run.map, k);
  }
  double read(const Map& map, turbomap::map_keyframe_id k) const {
    const auto* const p = map.motion(k);
    return map.velocity(k).x + map.bias(k).gyro.x + map.gravity().y + (p != nullptr ? p->dP.x + p->dt : 0);
  }
};

template <class Map>
void check_threads() {
  const mapping_recipe recipe = noisy_recipe();
  const mapping_scene<pinhole_camera> scene(pinhole_rig(50), recipe);
  inertial_mapping<Map, sequential> run(scene, in_small_parts(culled_inertial_options(recipe)), {}, sequential(),
                                        little_memory());
  mapper_threads threads(scene, run, with_imu<Map>{{scene}});
  threads.check(16);
  CHECK(threads.inertial_edges() > 0);
  // The chain of motions is whole: each spans the time from the keyframe before, however many were culled in between.
  std::size_t motions = 0, before = 0;
  for (std::size_t n = 1; n < run.keyframes().size(); ++n) {
    const auto k = run.keyframes()[n];
    if (!run.map.alive(k)) continue;
    const auto* const p = run.map.motion(k);
    REQUIRE(p != nullptr);
    CHECK(std::abs(p->dt - step_s * static_cast<double>(n - before)) < 1e-6);
    before = n, ++motions;
  }
  CHECK(motions > 5);
}

TEST_CASE("mapper, tracking and loop closing on one map with an IMU") { check_threads<shared_inertial_map>(); }
TEST_CASE("the same where the mapper works on a mirror with an IMU") { check_threads<mirrored_shared_map>(); }

}  // namespace
