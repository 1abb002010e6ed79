// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Matches of a device joined into tracks: the oracle's.

#include <thrust/system/cuda/execution_policy.h>

#include "support/stream.cuh"
#include "tracks_cases.hpp"

namespace {

using namespace turbomap_test;

TEST_CASE("tracks of searches are those of the oracle") {
  const stream on;
  track_tally t;
  for (const motion how : {motion::sideways, motion::forward, motion::anything}) {
    scene_recipe recipe;
    recipe.seed = 300 + static_cast<unsigned>(how), recipe.how = how, recipe.neighbours = 5, recipe.mapped = 0.1;
    recipe.prototypes = 40;
    scene<orb, pinhole_camera> mono(pinhole_rig(), recipe);
    check_tracks(on.policy(), mono, {}, t);
    scene<orb, fisheye_camera> three(fisheye_rig(3), recipe);
    check_tracks(on.policy(), three, {}, t);
  }
  CHECK(t.tracks > 200);
  CHECK(t.own > 5);
}

}  // namespace
