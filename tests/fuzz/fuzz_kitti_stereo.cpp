// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// KITTI stereo problems: calibration, poses and factors.

#include <turbomap/io/kitti_stereo.hpp>

#include "fuzz.hpp"

using namespace turbomap_fuzz;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto part = parts({reinterpret_cast<const char*>(data), size}, 3);
  const auto calibration = put("calibration.txt", part[0]), poses = put("poses.txt", part[1]),
             factors = put("factors.txt", part[2]);
  turbomap::kitti_stereo_problem p;
  if (!reads([&] { p = turbomap::read_kitti_stereo(calibration, poses, factors); })) return 0;
  turbomap::validate_rig(p.rig);
  const auto& d = p.data;
  expect(!d.T_cw.empty() && p.frame_id.size() == d.T_cw.size() && d.fixed.size() == d.T_cw.size(), "frames are whole");
  expect(p.landmark_id.size() == d.points.size(), "landmarks have ids");
  for (const auto& T : d.T_cw) expect(is_pose(T, 1e-9), "poses are normalised and finite");
  for (const auto& x : d.points) expect(finite({x.x, x.y, x.z}), "points are finite");
  for (std::size_t i = 0; i < d.observation_count(); ++i) {
    expect(static_cast<std::size_t>(d.frame[i]) < d.T_cw.size(), "frames are there");
    expect(static_cast<std::size_t>(d.landmark[i]) < d.points.size(), "landmarks are there");
    expect(finite({d.pixel[i].x, d.pixel[i].y, d.pixel[i].z}), "pixels are finite");
  }
  return 0;
}
