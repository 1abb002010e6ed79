// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Launch shapes of the kernels of the search by projection.

#include "../../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// launch_search_projections: a block takes `points` points in one camera, or `few` where there would be less than `blocks` blocks,
/// which a large device runs at once.
struct search_projections_tuning {
  static constexpr int threads = 128;  ///< per block
  static constexpr int points = 512;   ///< per block
  static constexpr int few = 128;      ///< per block of a small search
  static constexpr int blocks = 128;   ///< fewest
};

TURBOMAP_END_NAMESPACE
