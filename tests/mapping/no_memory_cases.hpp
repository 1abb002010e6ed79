// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes of a small scene are inserted and mapped, and a loop is closed, while the n-th allocation fails, for every n: an
/// exception, a sound map, a store as it was, nothing pinned, and the next call does the work. Which allocations fail, of the
/// host or of a device, or which other calls, is the test's affair.

#include <type_traits>
#include <vector>

#include "local_mapper_cases.hpp"
#include "support/fail_everywhere.hpp"

namespace turbomap_test {

/// A scene that takes few allocations, with adjustment on.
inline mapping_case<pinhole_camera> case_of_failures() {
  mapping_recipe small = noisy(2);
  small.per_metre = 8, small.clutter = 5;
  auto c = stereo_case(small);
  c.options.neighbours.neighbourhood.min_shared_points = 5;
  c.options.adjustment.min_shared_points = 5;
  return c;
}

inline turbomap::keyframe_store_options store_of_failures() {
  turbomap::keyframe_store_options store;
  store.chunk_bytes = std::size_t{1} << 16, store.byte_budget = std::size_t{20} << 16;
  return store;
}

struct failures_met {
  int inserting = 0, processing = 0;  ///< calls that failed in insert(), in process()
  std::size_t adjusted = 0;           ///< keyframes whose adjustment took a step
};

/// \param Failure  made with n: the n-th allocation from then on fails, until it is destroyed
/// \tparam Error   what is thrown then
template <class Failure, class Error = std::bad_alloc, class Run>
failures_met map_with_failures(Run& run, const mapping_scene<pinhole_camera>& scene, int keyframes) {
  using turbomap::stage_outcome;
  failures_met met;
  run.notes_creation = false;
  for (int n = 0; n < keyframes; ++n) {
    CAPTURE(n);
    const auto k = run.add();
    const auto& view = run.view(run.keyframes().size() - 1);
    const std::size_t stored = run.store.size();
    const auto data = scene.data<turbomap::binary_descriptor<256>>(view);
    met.inserting += fail_everywhere<Failure, Error>([&] { run.mapper.insert(k, data); },
                                                     [&] {
                                                       REQUIRE(run.store.size() == stored);
                                                       REQUIRE(run.mapper.stored().size() == stored);
                                                     });
    REQUIRE(run.store.size() == stored + 1);
    run.associate(k, view);
    met.processing += fail_everywhere<Failure, Error>([&] { run.mapper.process(k); },
                                                      [&] {
                                                        REQUIRE(turbomap::validate(run.map).empty());
                                                        REQUIRE(run.store.size() == run.mapper.stored().size());
                                                        REQUIRE(run.store.statistics().pinned_sets == 0);
                                                      });
    const auto& report = run.mapper.report();
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) CHECK(report.outcome.values[s] == stage_outcome::done);
    CHECK(report.refused.empty());
    CHECK(report.healed == 0);
    met.adjusted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    run.note();
  }
  CHECK(turbomap::validate(run.map).empty());
  CHECK(run.quality().merged_wrongly == 0);
  return met;
}

/// Calls that failed in fuse_around(), adjust_globally(), update_appearance().
struct closing_failures {
  int fusing = 0, adjusting = 0, updating = 0;
};

/// What loop closing calls, after a map was made.
/// \param Failure, Error  as above
template <class Failure, class Error = std::bad_alloc, class Run>
closing_failures close_with_failures(Run& run) {
  const auto sound = [&] {
    REQUIRE(turbomap::validate(run.map).empty());
    REQUIRE(run.store.statistics().pinned_sets == 0);
  };
  const auto last = run.keyframes().back();
  closing_failures met;
  met.fusing = fail_everywhere<Failure, Error>([&] { run.mapper.fuse_around(last); }, sound);
  met.adjusting = fail_everywhere<Failure, Error>([&] { run.mapper.adjust_globally(last, {}); }, sound);
  std::vector<turbomap::map_point_id> points;
  using traits = turbomap::map_traits<std::decay_t<decltype(run.map)>>;
  traits::for_each_point(run.map, [&](turbomap::map_point_id p) { points.push_back(p); });
  const turbomap::span<const turbomap::map_point_id> all(points.data(), points.size());
  met.updating = fail_everywhere<Failure, Error>([&] { run.mapper.update_appearance(all); }, sound);
  sound();
  return met;
}

}  // namespace turbomap_test
