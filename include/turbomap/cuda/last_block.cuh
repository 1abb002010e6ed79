// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which block of a grid is the last to be done: it can go on alone with what all of them wrote, without a launch of its own.

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether all other blocks of the grid have called this: one of them is told so. What the others wrote before is read with
/// __ldcg(), past this multiprocessor's own cache. All threads of the block take part. \param arrived  0 before the kernel
__device__ inline bool is_last_block(unsigned* arrived) {
  __shared__ bool last;
  __threadfence();  // what this thread wrote is seen before the count is
  __syncthreads();
  if (threadIdx.x == 0) last = atomicAdd(arrived, 1U) + 1 == gridDim.x;
  __syncthreads();
  __threadfence();
  return last;
}

TURBOMAP_END_NAMESPACE
