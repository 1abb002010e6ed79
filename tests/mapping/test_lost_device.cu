// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// A kernel of somebody else stops with an error, and every call of the run-time fails from then on (a sticky error): an
// exception that says so, a sound map, a store that can be asked and destroyed, and mapping goes on under a host policy. A
// program of its own, because its device does not come back.

#include <thrust/system/cuda/execution_policy.h>

#include "local_mapper_cases.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using map_type = mapped_by<pinhole_camera>;
using device_run = mapping_run<map_type, stream_policy, turbomap::local_adjustment<map_type, stream_policy>>;
using host_mapper =
    turbomap::local_mapper<map_type, sequential_policy, turbomap::local_adjustment<map_type, sequential_policy>>;

__global__ void stop() { asm("trap;"); }

TEST_CASE("a lost device: device_error, a sound map, and mapping goes on on the host") {
  const stream on;
  auto c = stereo_case(noisy(3));
  c.options.adjustment.min_shared_points = 5;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  device_run run(scene, c.options, {}, on.policy());
  run.notes_creation = false;
  run.steps(6);
  const auto before = run.keyframes().back();
  const std::string as_it_was = content(run.map);
  const std::size_t stored = run.store.size();

  stop<<<1, 1, 0, on.handle()>>>();
  REQUIRE(cudaStreamSynchronize(on.handle()) != cudaSuccess);

  CHECK_THROWS_AS(run.mapper.process(before), turbomap::device_error);
  CHECK(turbomap::validate(run.map).empty());
  CHECK(run.store.statistics().pinned_sets == 0);
  CHECK(run.store.size() == stored);
  CHECK(content(run.map) == as_it_was);  // no stage came to its commit
  const auto k = run.add();
  const auto data = scene.data<turbomap::binary_descriptor<256>>(run.view(run.keyframes().size() - 1));
  CHECK_THROWS_AS(run.mapper.insert(k, data), turbomap::device_error);
  CHECK(run.store.size() == stored);
  CHECK(run.mapper.stored().size() == stored);
  turbomap::array<char, turbomap::device_memory> memory;
  CHECK_THROWS_AS(memory.resize_discard(1000), turbomap::device_error);  // not out_of_memory

  // The system has its map and its keyframes: a store on the host gets those that live, as after loading a map.
  turbomap::context<sequential_policy> ctx;
  host_mapper::store_type store;
  host_mapper host(ctx, run.map, store, c.options);
  for (std::size_t n = 0; n < run.keyframes().size(); ++n)
    if (run.map.alive(run.keyframes()[n]))
      host.insert(run.keyframes()[n], scene.data<turbomap::binary_descriptor<256>>(run.view(n)));
  std::size_t created = 0, adjusted = 0;
  const auto map_one = [&](turbomap::map_keyframe_id next) {
    run.associate(next, run.view(run.keyframes().size() - 1));
    const auto& report = host.process(next);
    created += report.points_created, adjusted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    for (const auto outcome : report.outcome.values) CHECK(outcome == turbomap::stage_outcome::done);
    CHECK(report.refused.empty());
    CHECK(turbomap::validate(run.map).empty());
  };
  map_one(k);
  for (int n = 0; n < 6; ++n) {
    const auto next = run.add();
    host.insert(next, scene.data<turbomap::binary_descriptor<256>>(run.view(run.keyframes().size() - 1)));
    map_one(next);
  }
  CHECK(created > 5);
  CHECK(adjusted > 3);

  run.mapper.reset();  // what is left on the device can still be given up
  CHECK(run.store.size() == 0);
}

}  // namespace
