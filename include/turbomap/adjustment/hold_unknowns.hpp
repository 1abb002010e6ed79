// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Holds single unknowns of frames that move otherwise: takes their rows and columns out of the normal equations, and gives
/// them a diagonal of 1, so that their step is 0 under any damping.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../parallel.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = slot: couplings of a frame with a landmark.
template <class A, int V>
struct hold_couplings {
  schur_view<A> s;            ///< what is changed
  const std::uint32_t* held;  ///< [free frame] bit i: unknown i stays

  /// One slot.
  TURBOMAP_HD void operator()(int slot) const {
    const std::uint32_t mask = held[s.slot_frame[slot]];
    if ((mask & (~0U >> (32 - V))) == 0) return;
    for (int k = s.slot_coupling[slot]; k < s.slot_coupling[slot + 1]; ++k) {
      A* coupling = s.sums.coupling + static_cast<std::ptrdiff_t>(k) * 3 * V;
      for (int v = 0; v < V; ++v)
        if ((mask >> v & 1U) != 0)
          for (int m = 0; m < 3; ++m) coupling[m * V + v] = 0;
    }
  }
};

/// Index = free frame: its own block, and those of the factors whose first frame it is.
template <class A, int D>
struct hold_frames {
  schur_view<A> s;            ///< what is changed
  const std::uint32_t* held;  ///< [free frame] bit i: unknown i stays

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    const std::uint32_t mask = held[f];
    double* H = s.H + static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle;
    for (int r = 0, at = 0; r < D; ++r)
      for (int c = 0; c <= r; ++c, ++at)
        if (((mask >> r | mask >> c) & 1U) != 0) H[at] = r == c ? 1 : 0;
    for (int r = 0; r < D; ++r)
      if ((mask >> r & 1U) != 0) s.b[static_cast<std::ptrdiff_t>(f) * D + r] = 0;
    for (int k = s.frame_pair[f]; k < s.frame_pair[f + 1]; ++k) {
      const frame_neighbour& n = s.neighbours[k];
      if (n.is_first == 0) continue;
      const std::uint32_t other = held[n.other];
      double* square = s.sums.factor_square + static_cast<std::ptrdiff_t>(n.factor) * D * D;
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c)
          if (((mask >> r | other >> c) & 1U) != 0) square[r * D + c] = 0;
    }
  }
};

/// After launch_sum_frames(). \param held  [free frame]  \param slots  how many there are
template <int V, int D, class Derived, class A>
void launch_hold_unknowns(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                          const std::uint32_t* held, int slots) {
  static_assert(D <= 32, "turbomap: a mask of held unknowns has 32 bits");
  if (s.sums.coupling != nullptr) for_each_index(derived(policy), slots, hold_couplings<A, V>{s, held});
  for_each_index(derived(policy), s.free_frames, hold_frames<A, D>{s, held});
}

TURBOMAP_END_NAMESPACE
