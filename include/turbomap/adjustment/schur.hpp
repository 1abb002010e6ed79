// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Function objects of the Schur complement: sums of the frames, elimination of the landmarks, the reduced system
/// block by
/// block, back-substitution. Each index gathers its own sum from a fixed list; nothing is scattered.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "linearise_frame_factors.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A landmark after elimination: H + lambda I = L L^T.
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
  double lambda;

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
    const double a = h[0] + lambda, d = h[2] + lambda, f = h[5] + lambda;
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

/// Where the blocks of the reduced matrix go: row-major, the upper triangle of blocks. In a dense matrix of leading
/// dimension
/// `stride`, or one after the other (diagonal ones first).
struct reduced_layout {
  double* S;
  double* rhs;
  int stride;
  bool dense;

  TURBOMAP_HD double* block(int index, int row, int column, int free_frames, int D) const {
    if (dense) return S + static_cast<std::ptrdiff_t>(row) * D * stride + column * D;
    return S + (row == column ? static_cast<std::ptrdiff_t>(row) : static_cast<std::ptrdiff_t>(free_frames) + index) *
                   D * D;
  }
};

/// Index below free_frames: a diagonal block and its right hand side; above: one of the other blocks. Indices are
/// mixed, so
/// that neighbours (which one thread takes) are of all sizes.
template <class A, int V, int D>
struct reduce_blocks {
  schur_view<A> s;
  reduced_layout out;
  double lambda;
  int count, step;

  static constexpr int n = column_lanes<V>;
  static constexpr int ahead = 8;  ///< entries of a list between asking for memory and reading it
  static constexpr int row_bytes = 3 * V * static_cast<int>(sizeof(A));
  using P = pack<A, n>;

  TURBOMAP_HD void operator()(int i) const {
    const int task = static_cast<int>(static_cast<long long>(i) * step % count);
    if (task < s.free_frames)
      diagonal(task);
    else
      other(task - s.free_frames);
  }

 private:
  TURBOMAP_HD void diagonal(int f) const {
    P sum[V], right(A(0));
    for (int r = 0; r < V; ++r) sum[r] = P(A(0));
    const int last = s.frame_slot[f + 1] - 1;
    for (int k = s.frame_slot[f]; k <= last; ++k) {
      const int slot = s.slot_list[k], later = s.slot_list[k + ahead < last ? k + ahead : last];
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later) * 3 * V, row_bytes);
      prefetch(s.landmark[s.slot_landmark[later]].c, 24);
      const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const eliminated_landmark& e = s.landmark[s.slot_landmark[slot]];
      for (int m = 0; m < 3; ++m) {
        const P column = P::load(z + m * V);
        for (int r = 0; r < V; ++r) sum[r] = multiply_add(P(z[m * V + r]), column, sum[r]);
        right = multiply_add(P(static_cast<A>(e.c[m])), column, right);
      }
    }
    double* S = out.block(0, f, f, s.free_frames, D);
    const int stride = out.dense ? out.stride : D;
    A lanes[n];
    for (int r = 0; r < D; ++r) {
      if (r < V) sum[r].store(lanes);
      for (int c = 0; c < D; ++c) {
        const int h = r >= c ? r * (r + 1) / 2 + c : c * (c + 1) / 2 + r;
        double x = s.H[static_cast<std::ptrdiff_t>(f) * frame_block<D>::triangle + h];
        if (r == c) x += lambda;
        if (r < V && c < V) x -= static_cast<double>(lanes[c]);
        S[static_cast<std::ptrdiff_t>(r) * stride + c] = x;
      }
    }
    right.store(lanes);
    for (int r = 0; r < D; ++r)
      out.rhs[f * D + r] = s.b[static_cast<std::ptrdiff_t>(f) * D + r] - (r < V ? static_cast<double>(lanes[r]) : 0);
  }

  TURBOMAP_HD void other(int b) const {
    P sum[V];
    for (int r = 0; r < V; ++r) sum[r] = P(A(0));
    const int last = s.block_pair[b + 1] - 1;
    for (int k = s.block_pair[b]; k <= last; ++k) {
      const slot_pair& later = s.pairs[k + ahead < last ? k + ahead : last];
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later.first) * 3 * V, row_bytes);
      prefetch(s.eliminated + static_cast<std::ptrdiff_t>(later.second) * 3 * V, row_bytes);
      const A* first = s.eliminated + static_cast<std::ptrdiff_t>(s.pairs[k].first) * 3 * V;
      const A* second = s.eliminated + static_cast<std::ptrdiff_t>(s.pairs[k].second) * 3 * V;
      for (int m = 0; m < 3; ++m) {
        const P column = P::load(second + m * V);
        for (int r = 0; r < V; ++r) sum[r] = multiply_add(P(first[m * V + r]), column, sum[r]);
      }
    }
    double* S = out.block(b, s.block_row[b], s.block_column[b], s.free_frames, D);
    const int stride = out.dense ? out.stride : D;
    A lanes[n];
    for (int r = 0; r < D; ++r) {
      if (r < V) sum[r].store(lanes);
      for (int c = 0; c < D; ++c)
        S[static_cast<std::ptrdiff_t>(r) * stride + c] = r < V && c < V ? -static_cast<double>(lanes[c]) : 0;
    }
    for (int k = s.block_factor[b]; k < s.block_factor[b + 1]; ++k) {
      const int code = s.factor_list[k];
      const double* square = s.factor_square + static_cast<std::ptrdiff_t>(code / 2) * D * D;
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c)
          S[static_cast<std::ptrdiff_t>(r) * stride + c] += code % 2 == 0 ? square[r * D + c] : square[c * D + r];
    }
  }
};

/// All blocks of the reduced system.
template <class A, int V, int D, class Policy>
void launch_reduction(const Policy& policy, const schur_view<A>& s, const reduced_layout& out, double lambda) {
  const int count = s.free_frames + s.blocks;
  int step = count / 2 + count / 8;  // any number without a common divisor
  while (step > 1 && std::gcd(step, count) != 1) --step;
  for_each_index(policy, count, reduce_blocks<A, V, D>{s, out, lambda, count, step > 0 ? step : 1});
}

/// Index = some landmarks: their steps from those of the frames, their new positions, and sums of the step.
template <class A, int V, int D>
struct substitute_landmarks {
  static constexpr int landmarks_an_index = 16;
  schur_view<A> s;
  const double* step;  ///< of the free frames, D each
  double lambda;
  const double* from;
  double* to;
  double* predicted;  ///< [index] sum of dx (lambda dx + b): the decrease a quadratic cost would have
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
      for (int k = 0; k < 3; ++k) {
        to[l * landmark_stride + k] = from[l * landmark_stride + k] + dx[k];
        gain += dx[k] * (lambda * dx[k] + e.b[k]);
      }
    }
    predicted[i] = gain;
  }
};

TURBOMAP_END_NAMESPACE
