// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Local mapping on a map itself and on a mirror of it, while others write whatever they like into both and report it: the maps
// are the same to the last bit.

#include <thrust/execution_policy.h>

#include "mapper_world.hpp"
#include "scenes/mirrored_map.hpp"

using namespace turbomap_fuzz;

namespace {

using flat = turbomap::simple_map<turbomap::binary_descriptor<256>, turbomap_test::pinhole_camera>;
using mirrored = turbomap_test::mirrored_map<flat>;
using policy = std::decay_t<decltype(thrust::seq)>;
template <class Map>
using run_on = turbomap_test::mapping_run<Map, policy, turbomap::local_adjustment<Map, policy>>;

void live(bool stereo, choices& c) {
  const auto rig = turbomap_test::pinhole_rig(stereo ? 50 : 0);
  const turbomap_test::mapping_scene<turbomap_test::pinhole_camera> scene(rig, draw_recipe(c));
  auto options = draw_options(stereo ? 0.11 : 0, c);
  options.checked_share = c.flag() ? 0 : 1;
  twin_runs<run_on<flat>, run_on<mirrored>> twins(scene, options, draw_store(c));
  const auto compare = [&] {
    expect(turbomap_test::content(twins.first.map) == turbomap_test::content<flat>(twins.second.map),
           "a mirrored map is left as the map itself would be");
  };
  for (std::size_t n = 0, last = 3 + c.below(5); n < last; ++n) {
    for (unsigned edits = c.byte() % 4; edits > 0 && n > 1; --edits) twins.edit(c);
    twins.both([](auto& run) { run.mapper.process(run.track()); });
    compare();
  }
  const auto keyframes = keyframes_of(twins.first.map);
  const auto k = keyframes[c.below(keyframes.size())];
  switch (c.byte() % 4) {
    case 1:
      twins.both([&](auto& run) { run.mapper.adjust_globally(k, {}); });
      break;
    case 2:
      for (unsigned edits = c.byte() % 4; edits > 0; --edits) twins.edit(c);
      twins.both([&](auto& run) {
        if (run.map.alive(k)) run.mapper.fuse_around(k);
      });
      break;
    case 3:
      twins.both([](auto& run) { run.restart(); });
      for (int n = 0; n < 2; ++n) twins.both([](auto& run) { run.mapper.process(run.track()); });
      break;
    default:
      return;
  }
  compare();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  live(c.flag(), c);
  return 0;
}
