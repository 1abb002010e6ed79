// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A user with .cpp and .cu files in one program: both halves include the same headers, and neither sees the other's code.

#include "mixed.hpp"

#include <turbomap/math/linear.hpp>

int main() {
  turbomap::rigid_transform<double> pose;
  pose.qz = 1, pose.qw = 0;
  const auto here = turbomap::to_isometry<double>(pose) * turbomap::vec3<double>{1, 2, 3};
  const auto there = transform_in_cu(pose, {1, 2, 3});
  const bool equal = here.x == there.x && here.y == there.y && here.z == there.z;
  return equal && TURBOMAP_HAS_CUDA == 0 && compiled_for_cuda() ? 0 : 1;
}
