// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A C++ user: a pose of half a turn about z takes the point (1, 2, 3) to (-1, -2, 3).

#include <turbomap/math/linear.hpp>
#include <turbomap/types.hpp>

int main() {
  turbomap::rigid_transform<double> pose;
  pose.qz = 1, pose.qw = 0;
  const auto x = turbomap::to_isometry<double>(pose) * turbomap::vec3<double>{1, 2, 3};
  return x.x == -1 && x.y == -2 && x.z == 3 ? 0 : 1;
}
