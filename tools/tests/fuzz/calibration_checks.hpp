// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What readers of calibrations promise.

#include "simulation/calibration_file.hpp"

#include "fuzz/fuzz.hpp"

namespace turbomap_fuzz {

inline void expect_sound(const turbomap::simulation::simulated_camera& camera) {
  expect(camera.width > 38 && camera.height > 38, "images have a size");
  for (const double p : camera.parameters()) expect(finite({p}), "intrinsics are finite");
  expect(camera.parameters()[0] > 0 && camera.parameters()[1] > 0, "focal lengths are positive");
  const Eigen::Matrix3d R = camera.T_bc.linear();
  expect((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < 1e-9 && R.determinant() > 0,
         "a camera is mounted with a rotation");
  expect(camera.T_bc.translation().allFinite(), "a camera is mounted at a finite place");
}
inline void expect_sound(const turbomap::simulation::imu_noise& noise) {
  for (const double x : {noise.gyro, noise.acceleration, noise.gyro_walk, noise.acceleration_walk, noise.gyro_bias,
                         noise.acceleration_bias})
    expect(x >= 0 && x <= 1e4, "noise is in its range");
  expect(noise.rate_hz >= 1 && noise.rate_hz <= 1e4, "the rate is in its range");
}

}  // namespace turbomap_fuzz
