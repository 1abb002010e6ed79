// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// A file that uses the mapper of instantiated.hpp: two keyframes that see one point.

#include <cstdint>

#include "instantiated.hpp"

int main() {
  turbomap::context<my::policy> ctx;
  my::map_type map;
  turbomap::keyframe_store<my::orb, my::camera> store;
  my::mapper_type mapper(ctx, map, store, turbomap::local_mapper_options::stereo(0.1, 10));
  const auto rig = turbomap::make_mono_rig(my::camera{400, 400, 320, 240});
  turbomap::keypoint keypoint;
  keypoint.x = 400, keypoint.y = 200;
  const std::uint8_t descriptor[32] = {};
  turbomap::map_keyframe_id before;
  turbomap::map_point_id point;
  for (int n = 0; n < 2; ++n) {
    const auto k = map.add_keyframe({&keypoint, 1}, {}, n, before);
    if (n == 0) point = map.add_point({0.8, -0.4, 4}, k);
    turbomap::observe(map, point, k, 0);
    mapper.insert(k, turbomap::keyframe_data<my::orb, my::camera>{1, &keypoint, descriptor, rig.cameras, 1,
                                                                  turbomap::image_bounds{0, 0, 640, 480}});
    mapper.process(k);
    before = k;
  }
  return mapper.iterations() == 2 ? 0 : 1;
}
