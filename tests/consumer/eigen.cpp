// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A user of the component Eigen: conversions and the trajectory error.

#include <turbomap/interop/eigen.hpp>
#include <turbomap/io/trajectory_error.hpp>

int main() {
  const Eigen::Vector3d v = turbomap::to_eigen(turbomap::vec3<double>{1, 2, 3});
  return v.y() == 2 ? 0 : 1;
}
