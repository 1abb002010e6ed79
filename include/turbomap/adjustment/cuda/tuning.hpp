// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How adjustments are laid out for a CUDA device, and launch shapes of their kernels.

#include "../../config.hpp"
#include "../../memory.hpp"
#include "../factor_sums.hpp"
#include "../structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A thread computes a chunk, one observation at a time.
template <>
struct observation_shape<device_memory> {
  static constexpr int lanes = 1;
  static constexpr int chunk = observation_padding;
};

/// launch_sum_frames: one block per frame. Its warps take the partial sums of the frame in turn, a lane one element of each.
struct sum_frames_tuning {
  static constexpr int warps = 8;
};

TURBOMAP_END_NAMESPACE
