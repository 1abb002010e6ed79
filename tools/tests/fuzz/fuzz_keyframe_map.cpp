// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Maps in the .kfm format.

#include "evaluation/keyframe_map.hpp"

#include "fuzz/fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("m.kfm", {reinterpret_cast<const char*>(data), size});
  turbomap::evaluation::keyframe_map map;
  if (!reads([&] { map = turbomap::evaluation::read_keyframe_map(file); })) return 0;
  const auto& c = map.camera;
  expect(finite({c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3}), "the camera is finite");
  expect(map.width > 0 && map.height > 0 && map.descriptor_bytes >= 0, "images have a size");
  for (const auto& k : map.keyframes) {
    expect(is_pose(k.T_cw, 1e-2), "poses are poses");
    expect(k.landmarks.size() == k.pixels.size(), "every pixel has its landmark, or none");
    expect(k.descriptors.size() == k.pixels.size() * static_cast<std::size_t>(map.descriptor_bytes),
           "every pixel has its descriptor");
    for (const auto& uv : k.pixels) expect(finite({uv.x, uv.y}), "pixels are finite");
    for (const auto l : k.landmarks)
      expect(l >= -1 && l < static_cast<std::int64_t>(map.landmarks.size()), "landmarks are there");
  }
  for (const auto& l : map.landmarks)
    expect(finite({l.position.x, l.position.y, l.position.z}), "landmarks are finite");
  return 0;
}
