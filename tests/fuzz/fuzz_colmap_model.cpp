// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// COLMAP models: cameras.txt, images.txt and points3D.txt, the last of which may be missing.

#include <turbomap/io/colmap_model.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto part = parts({reinterpret_cast<const char*>(data), size}, 3);
  put("cameras.txt", part[0]), put("images.txt", part[1]);
  const bool with_points = !part[2].empty();
  if (with_points) {
    put("points3D.txt", part[2]);
  } else {
    std::filesystem::remove(folder() / "points3D.txt");
  }
  turbomap::colmap_model model;
  if (!reads([&] { model = turbomap::read_colmap_model(folder()); })) return 0;
  expect(!model.images.empty(), "a model has an image");
  for (const auto& [id, camera] : model.cameras) {
    const auto& m = camera.model;
    expect(camera.width > 0 && camera.height > 0 && m.fx > 0 && m.fy > 0, "cameras have a size and focal lengths");
    expect(finite({m.fx, m.fy, m.cx, m.cy, m.k1, m.k2, m.p1, m.p2}), "cameras are finite");
  }
  for (const auto& [id, x] : model.points) expect(finite({x.x, x.y, x.z}), "points are finite");
  for (const auto& [id, image] : model.images) {
    expect(model.cameras.count(image.camera) == 1, "cameras are there");
    expect(is_pose(image.T_cw, 1e-9), "poses are normalised and finite");
    expect(!image.name.empty(), "images have a name");
    for (const auto& o : image.observations) {
      expect(finite({o.pixel.x, o.pixel.y}), "pixels are finite");
      expect(o.point == -1 || (o.point >= 0 && !with_points) || model.points.count(o.point) == 1, "points are there");
    }
  }
  return 0;
}
