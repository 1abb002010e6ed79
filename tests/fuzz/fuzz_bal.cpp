// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Problems of Bundle Adjustment in the Large.

#include <turbomap/io/bal_factor.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("bal.txt", {reinterpret_cast<const char*>(data), size});
  turbomap::bal_problem p;
  if (!reads([&] { p = turbomap::read_bal(file); })) return 0;
  expect(p.camera.size() == p.point.size() && p.camera.size() == p.pixel.size(), "observations are complete");
  for (std::size_t i = 0; i < p.camera.size(); ++i) {
    expect(static_cast<std::size_t>(p.camera[i]) < p.cameras.size(), "cameras are there");
    expect(static_cast<std::size_t>(p.point[i]) < p.points.size(), "points are there");
    expect(finite({p.pixel[i].x, p.pixel[i].y}), "pixels are finite");
  }
  for (const auto& x : p.points) expect(finite({x.x, x.y, x.z}), "points are finite");
  for (const auto& c : p.cameras) {
    expect(finite({c.f, c.k1, c.k2}), "lenses are finite");
    expect(is_pose(turbomap::bal_pose(c), 1e-6), "bal_pose gives a pose");
    turbomap::bal_camera_of(turbomap::bal_state(c));
  }
  return 0;
}
