// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The n-th allocation fails, for every n, while a keyframe is inserted and mapped with everything on: the map is sound, the
/// store holds what the mapper knows, nothing stays pinned, and the next call does the work. See test_local_mapper.cpp for a
/// mapper that is new, and without adjustment.

#include <thrust/execution_policy.h>

#include "no_memory_cases.hpp"
#include "support/counted_new.hpp"

namespace turbomap_test {

/// Flat, and mirrored all the same.
struct mirrored_flat : mapped_by<pinhole_camera> {
  using mapped_by<pinhole_camera>::mapped_by;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::mirrored_flat>
    : turbomap::map_traits<turbomap_test::mapped_by<turbomap_test::pinhole_camera>> {
  static constexpr bool mirrored = true;
};

namespace {

using namespace turbomap_test;
using flat = mapped_by<pinhole_camera>;
template <class Map>
using adjusted_run = mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>>;

TEST_CASE_TEMPLATE("every allocation of insert and process may fail", Map, flat, mirrored_flat) {
  auto c = case_of_failures();
  c.options.covariances = true;
  c.options.checked_share = 1;          // of a mirror
  c.options.points_read_per_guard = 8;  // keyframes are culled in parts
  c.options.keyframe_culling.redundant_share = 0.5F, c.options.keyframe_culling.observers = 1;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  adjusted_run<Map> run(scene, c.options, {}, sequential_policy(), store_of_failures());
  const failures_met met = map_with_failures<no_memory_after>(run, scene, 14);
  CHECK(met.inserting > 10);
  CHECK(met.processing > 100);
  CHECK(met.adjusted > 8);
  CHECK(run.map.keyframe_count() < 12);  // culled
}

}  // namespace
