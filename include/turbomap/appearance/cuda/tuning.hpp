// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Launch shapes of the kernels of appearances.

#include "../../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// launch_compute_appearance: a warp per point for geometry, a block per point for the medoid. Most points have 5 to 30 views,
/// some 100: a block of 4 warps then has work for every lane.
struct appearance_tuning {
  static constexpr int warps = 4;  ///< per block
  /// Of shared memory for the descriptors of a point, in rows of an odd number of words: 180 of 488 bits, 47 of 64 floats.
  /// Those of 256 bits are bounded by `views`.
  static constexpr int descriptor_bytes = 12 * 1024;
  static constexpr int views = 256;  ///< so many views have their distances in shared memory; more are compared again
};

TURBOMAP_END_NAMESPACE
