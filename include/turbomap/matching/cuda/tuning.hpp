// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Launch shapes of the kernels of the correspondence search.

#include "../../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// launch_search_exhaustive: a block has 32 query keypoints and one neighbour, so a candidate that is read serves 32 comparisons
/// (tensor cores) or 4 (a warp's share without them). 10 neighbours, 800 keypoints: 250 blocks, which a large device runs at once.
struct search_exhaustive_tuning {
  static constexpr int warps = 8;    ///< per block
  static constexpr int queries = 4;  ///< per warp
  static constexpr int blocks = 2;   ///< at once per multiprocessor, as the registers of geometry allow
};

/// launch_prepare_search: a block per neighbour, which has one to three thousand keypoints, and a thread per pair of cameras.
struct prepare_search_tuning {
  static constexpr int threads = 256;  ///< per block
};

/// launch_create_tracks: a warp per track. Tracks are about as many as warps that run at once on a large device.
struct create_tracks_tuning {
  static constexpr int warps = 2;   ///< per block
  static constexpr int blocks = 4;  ///< at once per multiprocessor: every register that a thread can have
};

TURBOMAP_END_NAMESPACE
