// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The product of the reduced matrix with a vector, without forming the matrix: S p = H p - Z (Z^T p), first the landmarks'
/// Z^T p, then the rest frame by frame.

#include <cstddef>

#include "../config.hpp"
#include "../parallel.hpp"
#include "damping.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = landmark: y = sum of Z^T p over the frames that see it.
template <class A, int V, int D>
struct gather_landmarks {
  schur_view<A> s;  ///< landmarks and lists
  const double* p;  ///< D per free frame
  double* y;        ///< [landmark] 3

  /// Landmark l.
  TURBOMAP_HD void operator()(int l) const {
    double sum[3] = {};
    for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) add(slot, sum);
    for (int m = 0; m < 3; ++m) y[static_cast<std::ptrdiff_t>(l) * 3 + m] = sum[m];
  }
  /// Adds Z^T p of one slot.
  TURBOMAP_HD void add(int slot, double (&sum)[3]) const {
    const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
    const double* x = p + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * D;
    for (int m = 0; m < 3; ++m)
      for (int v = 0; v < V; ++v) sum[m] += static_cast<double>(z[m * V + v]) * x[v];
  }
};

/// Index = free frame: q = S p.
template <class A, int V, int D>
struct multiply_frames {
  schur_view<A> s;            ///< landmarks and lists
  const double* p;            ///< D per free frame
  const double* y;            ///< [landmark] 3: Z^T p
  turbomap::damping damping;  ///< of the diagonal
  double* q;                  ///< D per free frame

  /// Free frame f.
  TURBOMAP_HD void operator()(int f) const {
    double sum[D];
    for (int r = 0; r < D; ++r) sum[r] = of_frames(f, r);
    for (int k = s.frame_slot[f]; k < s.frame_slot[f + 1]; ++k) subtract(s.slot_list[k], sum);
    for (int r = 0; r < D; ++r) q[static_cast<std::ptrdiff_t>(f) * D + r] = sum[r];
  }
  /// Row r of H p: of the frame itself, and of the factors between it and others.
  TURBOMAP_HD double of_frames(int f, int r) const {
    const double* H = s.H + static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle;
    const double* x = p + static_cast<std::ptrdiff_t>(f) * D;
    double sum = damping(H[r * (r + 3) / 2]) * x[r];
    for (int c = 0; c < D; ++c) sum += H[r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r] * x[c];
    for (int k = s.frame_pair[f]; k < s.frame_pair[f + 1]; ++k) {
      const frame_neighbour& n = s.neighbours[k];
      const double* square = s.sums.factor_square + static_cast<std::ptrdiff_t>(n.factor) * D * D;
      const double* other = p + static_cast<std::ptrdiff_t>(n.other) * D;
      for (int c = 0; c < D; ++c) sum += (n.is_first != 0 ? square[r * D + c] : square[c * D + r]) * other[c];
    }
    return sum;
  }
  /// A slot's part of -Z y. \param sum  V numbers or more
  template <int N>
  TURBOMAP_HD void subtract(int slot, double (&sum)[N]) const {
    static_assert(N >= V);
    const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
    const double* l = y + static_cast<std::ptrdiff_t>(s.slot_landmark[slot]) * 3;
    for (int m = 0; m < 3; ++m)
      for (int v = 0; v < V; ++v) sum[v] -= static_cast<double>(z[m * V + v]) * l[m];
  }
};

/// y = Z^T p, 3 numbers per landmark.
template <int V, int D, class Derived, class A>
void launch_gather_landmarks(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s, const double* p,
                             double* y) {
  for_each_index(derived(policy), s.landmarks, gather_landmarks<A, V, D>{s, p, y});
}

/// q = S p. \param y  of launch_gather_landmarks()
template <int V, int D, class Derived, class A>
void launch_multiply_frames(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s, const double* p,
                            const double* y, const damping& damping, double* q) {
  for_each_index(derived(policy), s.free_frames, multiply_frames<A, V, D>{s, p, y, damping, q});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/schur_product.cuh"
#endif
