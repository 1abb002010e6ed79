// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How the steps of a bundle adjustment are damped, by name: for structures of options, which include nothing heavier.

#include <cstdint>

namespace turbomap {

/// What is added to the normal equations H to make a step shorter.
enum class damping_rule : std::uint8_t {
  identity,  ///< H + lambda I [g2o, ORB-SLAM3]: depends on the units
  diagonal   ///< H + lambda diag(H) [Marquardt 1963; Ceres]: unknowns of any units and scales
};

}  // namespace turbomap
