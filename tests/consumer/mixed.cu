// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The CUDA half of the mixed user.

#include "mixed.hpp"

#include <turbomap/math/linear.hpp>

turbomap::vec3<double> transform_in_cu(const turbomap::rigid_transform<double>& pose, turbomap::vec3<double> x) {
  return turbomap::to_isometry<double>(pose) * x;
}

bool compiled_for_cuda() { return TURBOMAP_HAS_CUDA == 1; }
