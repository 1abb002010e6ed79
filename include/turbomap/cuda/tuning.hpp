// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Launch shapes of the kernels that are shared by all stages.

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Shared memory that a block may declare, on every device; more must be asked for at the launch.
inline constexpr int shared_memory_bytes = 48 * 1024;

/// for_each_index: one thread per index. 128 threads leave registers enough for the geometry of a pair (up to 512 each).
struct for_each_tuning {
  static constexpr int block_size = 128;  ///< threads
};

/// launch_list_found: one thread per index; some ten to some hundred blocks.
struct list_found_tuning {
  static constexpr int threads = 512;  ///< per block
};

TURBOMAP_END_NAMESPACE
