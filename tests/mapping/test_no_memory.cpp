// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The n-th allocation fails, for every n, while a keyframe is inserted and mapped with everything on: the map is sound, the
/// store holds what the mapper knows, nothing stays pinned, and the next call does the work. See test_local_mapper.cpp for a
/// mapper that is new, and without adjustment.

#include <thrust/execution_policy.h>

#include "local_mapper_cases.hpp"
#include "support/counted_new.hpp"
#include "support/fail_everywhere.hpp"

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
using turbomap::mapping_stage;
using turbomap::stage_outcome;
using flat = mapped_by<pinhole_camera>;
template <class Map>
using adjusted_run = mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>>;

TEST_CASE_TEMPLATE("every allocation of insert and process may fail", Map, flat, mirrored_flat) {
  mapping_recipe small = noisy(2);
  small.per_metre = 8, small.clutter = 5;
  auto c = stereo_case(small);
  c.options.neighbours.neighbourhood.min_shared_points = 5;
  c.options.adjustment.min_shared_points = 5;
  c.options.covariances = true;
  c.options.checked_share = 1;  // of a mirror
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  turbomap::keyframe_store_options store;
  store.chunk_bytes = std::size_t{1} << 16, store.byte_budget = std::size_t{20} << 16;
  adjusted_run<Map> run(scene, c.options, {}, sequential_policy(), store);
  run.notes_creation = false;
  int inserting = 0, processing = 0;
  std::size_t adjusted = 0;
  for (int n = 0; n < 14; ++n) {
    CAPTURE(n);
    const auto k = run.add();
    const auto& view = run.view(run.keyframes().size() - 1);
    const std::size_t stored = run.store.size();
    const auto data = scene.data<turbomap::binary_descriptor<256>>(view);
    inserting += fail_everywhere<no_memory_after>([&] { run.mapper.insert(k, data); },
                                                  [&] {
                                                    REQUIRE(run.store.size() == stored);
                                                    REQUIRE(run.mapper.stored().size() == stored);
                                                  });
    REQUIRE(run.store.size() == stored + 1);
    run.associate(k, view);
    processing += fail_everywhere<no_memory_after>([&] { run.mapper.process(k); },
                                                   [&] {
                                                     REQUIRE(turbomap::validate(run.map).empty());
                                                     REQUIRE(run.store.size() == run.mapper.stored().size());
                                                     REQUIRE(run.store.statistics().pinned_sets == 0);
                                                   });
    const auto& report = run.mapper.report();
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) CHECK(report.outcome.values[s] == stage_outcome::done);
    CHECK(report.refused.empty());
    CHECK(report.healed == 0);
    adjusted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    run.note();
  }
  CHECK(inserting > 10);
  CHECK(processing > 100);
  CHECK(adjusted > 8);
  CHECK(turbomap::validate(run.map).empty());
  CHECK(run.quality().merged_wrongly == 0);
}

}  // namespace
