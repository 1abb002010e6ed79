// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Kalibr files of a rig.

#include "fuzz/fuzz.hpp"
#include "tests/fuzz/calibration_checks.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = put("c.yaml", {reinterpret_cast<const char*>(data), size});
  turbomap::simulation::simulated_rig rig;
  if (!reads([&] { rig = turbomap::simulation::read_rig(file); })) return 0;
  expect(rig.cameras.size() == 1 || (rig.cameras.size() == 2 && rig.cameras[0].is_fisheye()), "one camera, or two");
  for (const auto& camera : rig.cameras) {
    expect_sound(camera);
    expect(camera.is_fisheye() == rig.cameras[0].is_fisheye(), "cameras are of one model");
  }
  expect(finite({rig.baseline, rig.close_depth}) && rig.baseline >= 0, "the baseline is a length");
  expect_sound(rig.imu);
  return 0;
}
