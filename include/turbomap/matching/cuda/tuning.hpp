// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Launch shapes of the kernels of the correspondence search.

#include "../../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// launch_search_exhaustive: a warp compares 4 query keypoints with all candidates of a neighbour. More would share each
/// candidate that is read among more comparisons; 4 leave warps enough for a large device (10 neighbours, 1000 keypoints: 2500).
struct search_exhaustive_tuning {
  static constexpr int warps = 4;
  static constexpr int queries = 4;
  static constexpr int blocks = 4;  ///< at once per multiprocessor: geometry, which is rare, would take registers of two
};

/// launch_create_tracks: a warp per track. Tracks are about as many as warps that run at once on a large device.
struct create_tracks_tuning {
  static constexpr int warps = 2;
};

TURBOMAP_END_NAMESPACE
