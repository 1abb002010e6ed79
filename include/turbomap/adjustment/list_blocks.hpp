// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the lists of the blocks of a full reduced matrix are made: on the host (block_finder.hpp), unless the policy makes
/// them where it computes. Then every two free frames have a block, which may be empty, in the order of block_finder.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "block_finder.hpp"
#include "schur_view.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Lists the blocks of a problem in scratch memory of the context, and fills in the view. False: it leaves that to the host, and
/// nothing was launched.
template <class Derived, class Arena, class A>
bool launch_list_blocks(const thrust::execution_policy<Derived>&, Arena&, const adjustment_structure&, schur_view<A>&) {
  return false;
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/list_blocks.cuh"
#endif
