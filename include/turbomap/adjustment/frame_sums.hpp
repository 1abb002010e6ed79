// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sums the normal equations of each frame out of the partial sums of its chunks and factors, in the order of their lists.

#include <cstddef>

#include "../config.hpp"
#include "../parallel.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = free frame: sums H and b of what its factors gave.
template <class A, int V, int D>
struct sum_frames {
  schur_view<A> s;  ///< what is read and written

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    using chunk = landmark_block<V>;
    using whole = frame_block<D>;
    double total[whole::partial] = {};
    for (int k = s.frame_partial[f]; k < s.frame_partial[f + 1]; ++k) {
      const double* p = s.sums.chunk_partial + static_cast<std::ptrdiff_t>(s.partial_list[k]) * chunk::partial;
      for (int i = 0; i < chunk::triangle; ++i) total[i] += p[i];
      for (int i = 0; i < V; ++i) total[whole::triangle + i] += p[chunk::triangle + i];
    }
    for (int k = s.frame_factor[f]; k < s.frame_factor[f + 1]; ++k) {
      const double* p = s.sums.factor_partial + static_cast<std::ptrdiff_t>(s.frame_factor_list[k]) * whole::partial;
      for (int i = 0; i < whole::partial; ++i) total[i] += p[i];
    }
    for (int i = 0; i < whole::triangle; ++i) s.H[static_cast<std::ptrdiff_t>(f) * whole::triangle + i] = total[i];
    for (int i = 0; i < D; ++i) s.b[static_cast<std::ptrdiff_t>(f) * D + i] = total[whole::triangle + i];
  }
};

/// \tparam V  unknowns of a frame that landmarks depend on  \tparam D  all unknowns of a frame
template <int V, int D, class Derived, class A>
void launch_sum_frames(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s) {
  for_each_index(derived(policy), s.free_frames, sum_frames<A, V, D>{s});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/sum_frames.cuh"
#endif
