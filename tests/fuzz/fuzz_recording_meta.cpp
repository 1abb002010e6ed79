// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// meta.json of a recording. What is read can be written, and is the same when it is read again.

#include <turbomap/io/recording_meta.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("meta.json", {reinterpret_cast<const char*>(data), size});
  turbomap::recording_meta m;
  if (!reads([&] { m = turbomap::read_recording_meta(file); })) return 0;
  expect(m.width > 0 && m.height > 0, "an image has a size");
  expect(m.camera1[0] > 0 && m.camera1[1] > 0, "focal lengths are positive");
  for (const double c : m.camera1) expect(finite({c}), "cameras are finite");
  for (const double c : m.camera2) expect(finite({c}), "cameras are finite");
  for (const auto& T : {m.T_lr, m.T_rl, m.T_bc}) expect(is_pose(T, 2e-3), "transforms are poses");
  expect(m.levels >= 1 && std::isfinite(m.scale_factor) && m.scale_factor > 1, "the pyramid is one");
  for (const auto* list : {&m.scale_factors, &m.level_sigma2, &m.inv_level_sigma2}) {
    expect(list->size() == static_cast<std::size_t>(m.levels), "there is a number per level");
    for (const float x : *list) expect(std::isfinite(x) && x > 0, "numbers of levels are positive");
  }
  expect(finite({m.bounds.min_x, m.bounds.min_y, m.bounds.max_x, m.bounds.max_y}), "bounds are finite");
  expect(m.bounds.max_x > m.bounds.min_x && m.bounds.max_y > m.bounds.min_y, "bounds enclose an area");
  expect(m.bf >= 0 && m.baseline >= 0 && finite({m.bf, m.baseline, m.close_depth}), "baselines are not negative");

  turbomap::write_recording_meta(folder() / "w.json", m);
  turbomap::write_recording_meta(folder() / "v.json", turbomap::read_recording_meta(folder() / "w.json"));
  expect(turbomap_test::file_bytes(folder() / "w.json") == turbomap_test::file_bytes(folder() / "v.json"),
         "meta.json is read back as it was written");
  return 0;
}
