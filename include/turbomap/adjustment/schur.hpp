// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Function objects of the Schur complement: sums of the frames, elimination of the landmarks, back-substitution. Each
/// index gathers its own sum from a fixed list; nothing is scattered.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "damping.hpp"
#include "linearise_frame_factors.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A landmark after elimination: damped H = L L^T.
struct eliminated_landmark {
  double inverse[6];  ///< of L, lower triangle; 0: it does not move (along this direction)
  double c[3];        ///< L^-1 b
  double b[3];
};

/// Lanes that hold a column of V numbers; what is beyond V is read but means nothing.
template <int V>
inline constexpr int column_lanes = TURBOMAP_VECTOR_BYTES == 0 ? V
                                    : (V + 3) / 4 * 4 == 4     ? 4
                                                               : (V + 7) / 8 * 8;

/// Views of the lists of adjustment_structure and of the sums, where the policy computes.
template <class A>
struct schur_view {
  const std::int32_t *landmark_row, *landmark_slot, *slot_coupling, *slot_frame, *slot_landmark;
  const std::int32_t *frame_partial, *partial_list, *frame_slot, *slot_list;
  const std::int32_t *frame_factor, *frame_factor_list;
  const std::int32_t* frame_pair;
  const frame_neighbour* frame_pair_list;
  const std::int32_t *block_row, *block_column, *block_pair, *block_factor, *factor_list;
  const slot_pair* pairs;
  const std::uint8_t* landmark_fixed;  ///< null: none
  const double* chunk_partial;         ///< landmark_block<V>::partial a chunk
  const double* factor_partial;        ///< frame_block<D>::partial a factor's frame
  const double* factor_square;
  const A* row;
  const A* coupling;
  A* eliminated;  ///< [slot] Z = coupling L^-T, as couplings
  eliminated_landmark* landmark;
  double* H;  ///< [free frame] lower triangle
  double* b;  ///< [free frame]
  int free_frames, blocks;
};

/// Index = free frame: sums H and b of what its factors gave.
template <class A, int V, int D>
struct sum_frames {
  schur_view<A> s;

  TURBOMAP_HD void operator()(int f) const {
    using chunk = landmark_block<V>;
    using whole = frame_block<D>;
    double total[whole::partial] = {};
    for (int k = s.frame_partial[f]; k < s.frame_partial[f + 1]; ++k) {
      const double* p = s.chunk_partial + static_cast<std::ptrdiff_t>(s.partial_list[k]) * chunk::partial;
      for (int i = 0; i < chunk::triangle; ++i) total[i] += p[i];
      for (int i = 0; i < V; ++i) total[whole::triangle + i] += p[chunk::triangle + i];
    }
    for (int k = s.frame_factor[f]; k < s.frame_factor[f + 1]; ++k) {
      const double* p = s.factor_partial + static_cast<std::ptrdiff_t>(s.frame_factor_list[k]) * whole::partial;
      for (int i = 0; i < whole::partial; ++i) total[i] += p[i];
    }
    for (int i = 0; i < whole::triangle; ++i) s.H[static_cast<std::ptrdiff_t>(f) * whole::triangle + i] = total[i];
    for (int i = 0; i < D; ++i) s.b[static_cast<std::ptrdiff_t>(f) * D + i] = total[whole::triangle + i];
  }
};

namespace detail {

/// Sum of the rows of a landmark: H (lower triangle), then b.
template <class A>
TURBOMAP_HD void sum_rows(const schur_view<A>& s, int l, double (&total)[9]) {
  using P = pack<A, 8>;
  P head(A(0));
  A last(0);
  for (int r = s.landmark_row[l]; r < s.landmark_row[l + 1]; ++r) {
    const A* row = s.row + static_cast<std::ptrdiff_t>(r) * 9;
    head = head + P::load(row);
    last += row[8];
  }
  A out[8];
  head.store(out);
  for (int i = 0; i < 8; ++i) total[i] = static_cast<double>(out[i]);
  total[8] = static_cast<double>(last);
}

}  // namespace detail

/// Index = landmark: largest diagonal element of its H.
template <class A>
struct scale_of_landmarks {
  schur_view<A> s;
  double* diagonal;

  TURBOMAP_HD void operator()(int l) const {
    double h[9];
    detail::sum_rows(s, l, h);
    const bool fixed = s.landmark_fixed != nullptr && s.landmark_fixed[l] != 0;
    diagonal[l] = fixed ? 0 : larger(h[0], larger(h[2], h[5]));
  }
};

/// Index = landmark: factorises its block, damped, and takes its couplings through the factor.
template <class A, int V>
struct eliminate_landmarks {
  schur_view<A> s;
  turbomap::damping damping;

  TURBOMAP_HD void operator()(int l) const {
    double h[9];
    detail::sum_rows(s, l, h);
    eliminated_landmark e{};
    const bool fixed = s.landmark_fixed != nullptr && s.landmark_fixed[l] != 0;
    if (!fixed) factorise(h, e);
    for (int i = 0; i < 3; ++i) e.b[i] = h[6 + i];
    e.c[0] = e.inverse[0] * h[6];
    e.c[1] = e.inverse[1] * h[6] + e.inverse[2] * h[7];
    e.c[2] = e.inverse[3] * h[6] + e.inverse[4] * h[7] + e.inverse[5] * h[8];
    s.landmark[l] = e;

    constexpr int n = column_lanes<V>;
    using P = pack<A, n>;
    P inverse[6];
    for (int i = 0; i < 6; ++i) inverse[i] = P(static_cast<A>(e.inverse[i]));
    for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) {
      P w[3] = {P(A(0)), P(A(0)), P(A(0))};
      for (int k = s.slot_coupling[slot]; k < s.slot_coupling[slot + 1]; ++k) {
        const A* coupling = s.coupling + static_cast<std::ptrdiff_t>(k) * 3 * V;
        for (int m = 0; m < 3; ++m) w[m] = w[m] + P::load(coupling + m * V);
      }
      // What a column's store leaves beyond it, the next column overwrites; the last one must not reach the next slot.
      A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const P z0 = w[0] * inverse[0], z1 = multiply_add(w[0], inverse[1], w[1] * inverse[2]);
      const P z2 = multiply_add(w[0], inverse[3], multiply_add(w[1], inverse[4], w[2] * inverse[5]));
      z0.store(z);
      z1.store(z + V);
      store_column(z + 2 * V, z2);
    }
  }

 private:
  static_assert(column_lanes<V> <= 2 * V);
  /// V numbers and none more: the next slot may be another thread's.
  TURBOMAP_HD static void store_column(A* to, const pack<A, column_lanes<V>>& column) {
    A lanes[column_lanes<V>];
    column.store(lanes);
    for (int i = 0; i < V; ++i) to[i] = lanes[i];
  }

  /// A direction whose pivot is lost in the rounding of A is left alone: a landmark seen once, hardly damped.
  TURBOMAP_HD void factorise(const double (&h)[9], eliminated_landmark& e) const {
    const double noise = 16 * detail::epsilon<A>::value;
    const double a = h[0] + damping(h[0]), d = h[2] + damping(h[2]), f = h[5] + damping(h[5]);
    const double i00 = a > 0 ? 1 / ::sqrt(a) : 0;
    const double l10 = h[1] * i00, l20 = h[3] * i00, p11 = d - l10 * l10;
    const double i11 = p11 > noise * d ? 1 / ::sqrt(p11) : 0;
    const double l21 = (h[4] - l20 * l10) * i11, p22 = f - l20 * l20 - l21 * l21;
    const double i22 = p22 > noise * f ? 1 / ::sqrt(p22) : 0;
    e.inverse[0] = i00, e.inverse[2] = i11, e.inverse[5] = i22;
    e.inverse[1] = -l10 * i00 * i11;
    e.inverse[4] = -l21 * i11 * i22;
    e.inverse[3] = -(l20 * i00 + l21 * e.inverse[1]) * i22;
  }
};

/// Index = some landmarks: their steps from those of the frames, their new positions, and sums of the step.
template <class A, int V, int D>
struct substitute_landmarks {
  static constexpr int landmarks_an_index = 16;
  schur_view<A> s;
  const double* step;  ///< of the free frames, D each
  turbomap::damping damping;
  const double* from;
  double* to;
  double* predicted;  ///< [index] sum of dx (damping dx + b): the decrease a quadratic cost would have
  int landmarks;

  TURBOMAP_HD void operator()(int i) const {
    double gain = 0;
    const int end = (i + 1) * landmarks_an_index < landmarks ? (i + 1) * landmarks_an_index : landmarks;
    for (int l = i * landmarks_an_index; l < end; ++l) {
      const eliminated_landmark& e = s.landmark[l];
      double y[3] = {e.c[0], e.c[1], e.c[2]};
      for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) {
        const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
        const double* x = step + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * D;
        for (int m = 0; m < 3; ++m)
          for (int v = 0; v < V; ++v) y[m] -= static_cast<double>(z[m * V + v]) * x[v];
      }
      const double dx[3] = {e.inverse[0] * y[0] + e.inverse[1] * y[1] + e.inverse[3] * y[2],
                            e.inverse[2] * y[1] + e.inverse[4] * y[2], e.inverse[5] * y[2]};
      double held[3] = {damping.lambda, damping.lambda, damping.lambda};
      if (damping.scaled) {
        double h[9];
        detail::sum_rows(s, l, h);
        held[0] = damping(h[0]), held[1] = damping(h[2]), held[2] = damping(h[5]);
      }
      for (int k = 0; k < 3; ++k) {
        to[l * landmark_stride + k] = from[l * landmark_stride + k] + dx[k];
        gain += dx[k] * (held[k] * dx[k] + e.b[k]);
      }
      to[l * landmark_stride + 3] = 0;  // copied to the host with the others
    }
    predicted[i] = gain;
  }
};

TURBOMAP_END_NAMESPACE
