// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Eliminates the landmarks from the normal equations (the Schur complement's first half). The block of each landmark is
/// 3x3 and meets frames alone, so H = L L^T is factorised landmark by landmark, and its couplings are taken through L: what
/// is then left for the frames is the products of these columns (reduced_system.hpp).

#include <cmath>
#include <cstddef>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "compact_columns.hpp"
#include "damping.hpp"
#include "equal_shares.hpp"
#include "frame_sums.hpp"
#include "row_couplings.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = landmark: largest diagonal element of its H.
template <class A>
struct scale_of_landmarks {
  schur_view<A> s;   ///< the landmarks
  double* diagonal;  ///< [landmark]; 0: it does not move

  /// Landmark l.
  TURBOMAP_HD void operator()(int l) const {
    double h[9];
    detail::sum_rows(s, l, h);
    diagonal[l] = s.moves(l) ? larger(h[0], larger(h[2], h[5])) : 0;
  }
};

/// Index = landmark: what a step along its gradient alone would gain, element by element: the sum of b^2 / h.
template <class A>
struct gain_of_landmarks {
  schur_view<A> s;  ///< the landmarks
  double* gain;     ///< [landmark]

  /// Landmark l.
  TURBOMAP_HD void operator()(int l) const {
    double h[9], sum = 0;
    detail::sum_rows(s, l, h);
    const double diagonal[3] = {h[0], h[2], h[5]};
    for (int i = 0; i < 3; ++i) sum += diagonal[i] > 0 ? h[6 + i] * h[6 + i] / diagonal[i] : 0;
    gain[l] = s.moves(l) ? sum : 0;
  }
};

/// Index = some landmarks: factorises their blocks, damped, and takes their couplings through the factors. All are factorised
/// first: roots and quotients of one landmark wait for each other, not for those of the next.
/// \tparam Compact  gives compact columns; couplings are made of rows
template <class A, int V, bool Compact = false>
struct eliminate_landmarks {
  static constexpr int landmarks_per_index = 16;  ///< landmarks that one thread takes
  schur_view<A> s;                                ///< what is read and written
  turbomap::damping damping;                      ///< added to their diagonals

  /// The landmarks of index i.
  TURBOMAP_HD void operator()(int i) const {
    const int begin = i * landmarks_per_index;
    const int end = begin + landmarks_per_index < s.landmarks ? begin + landmarks_per_index : s.landmarks;
    for (int l = begin; l < end; ++l) {
      double h[9];
      detail::sum_rows(s, l, h);
      s.landmark[l] = eliminate(l, h);
    }
    for (int l = begin; l < end; ++l) {
      if constexpr (Compact)
        make_compact_columns(l);
      else
        take_couplings(l);
    }
  }

  /// Landmark l from the sum of its rows.
  TURBOMAP_HD eliminated_landmark eliminate(int l, const double (&h)[9]) const {
    eliminated_landmark e;
    factorise(h, s.moves(l), e);
    for (int i = 0; i < 3; ++i) e.b[i] = h[6 + i];
    e.c[0] = e.inverse[0] * h[6];
    e.c[1] = e.inverse[1] * h[6] + e.inverse[2] * h[7];
    e.c[2] = e.inverse[3] * h[6] + e.inverse[4] * h[7] + e.inverse[5] * h[8];
    return e;
  }

  /// The inverse of L, as columns are multiplied by it.
  using P = pack<A, column_lanes<V>>;
  /// The factor of a landmark in all lanes.
  struct factor {
    P inverse[6];  ///< lower triangle, row by row
  };
  /// The factor of an eliminated landmark.
  TURBOMAP_HD static factor factor_of(const eliminated_landmark& e) {
    factor f;
    for (int i = 0; i < 6; ++i) f.inverse[i] = P(static_cast<A>(e.inverse[i]));
    return f;
  }

  /// Takes the coupling of a slot through the factor of its landmark.
  TURBOMAP_HD void take_through(int slot, const factor& f) const {
    P w[3] = {P(A(0)), P(A(0)), P(A(0))};
    for (int k = s.slot_coupling[slot]; k < s.slot_coupling[slot + 1]; ++k) {
      const A* coupling = s.sums.coupling + static_cast<std::ptrdiff_t>(k) * 3 * V;
      for (int m = 0; m < 3; ++m) w[m] = w[m] + P::load(coupling + m * V);
    }
    take_through(slot, w, f);
  }
  /// The same with the coupling's columns in `w`.
  TURBOMAP_HD void take_through(int slot, const P (&w)[3], const factor& f) const {
    P z[3];
    multiply(w, f, z);
    // What a column's store leaves beyond it, the next column overwrites; the last one must not reach the next slot.
    A* const to = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
    if constexpr (column_lanes<V> <= 2 * V) {
      z[0].store(to);
      z[1].store(to + V);
    } else {  // a column of one number: that store would reach the next slot, too
      store_column(to, z[0]);
      store_column(to + V, z[1]);
    }
    store_column(to + 2 * V, z[2]);
  }
  /// The columns of a coupling by the factor of its landmark.
  TURBOMAP_HD static void multiply(const P (&w)[3], const factor& f, P (&z)[3]) {
    z[0] = w[0] * f.inverse[0], z[1] = multiply_add(w[0], f.inverse[1], w[1] * f.inverse[2]);
    z[2] = multiply_add(w[0], f.inverse[3], multiply_add(w[1], f.inverse[4], w[2] * f.inverse[5]));
  }

 private:
  /// Takes the couplings of landmark l through its factor.
  TURBOMAP_HD void take_couplings(int l) const {
    const factor inverse = factor_of(s.landmark[l]);
    if (s.sums.coupling != nullptr)
      for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) take_through(slot, inverse);
    else
      make_couplings(l, inverse);
  }
  /// Takes the couplings of landmark l, made of its rows, through its factor.
  TURBOMAP_HD void make_couplings(int l, const factor& inverse) const {
    const double* p = s.positions + static_cast<std::ptrdiff_t>(l) * landmark_stride;
    int row = s.landmark_row[l];  // those of free frames come first, in the order of slots
    for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) {
      const int count = s.slot_coupling[slot + 1] - s.slot_coupling[slot];
      P w[3];
      make_coupling<V>(s, s.slot_frame[slot], row, count, p, w);
      take_through(slot, w, inverse);
      row += count;
    }
  }

  /// Compact columns of landmark l.
  TURBOMAP_HD void make_compact_columns(int l) const {
    const compact_factor<A> factor(s.landmark[l]);
    const double* p = s.positions + static_cast<std::ptrdiff_t>(l) * landmark_stride;
    const A* h = s.sums.row + static_cast<std::ptrdiff_t>(s.landmark_row[l]) * landmark_block<V>::row;
    for (int slot = s.landmark_slot[l]; slot < s.landmark_slot[l + 1]; ++slot) {
      const int count = s.slot_coupling[slot + 1] - s.slot_coupling[slot];
      A all[6];
      const double* centre = s.centres + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * landmark_stride;
      make_compact_column(sum_of_rows(h, count, all), factor, p, centre,
                          s.eliminated + static_cast<std::ptrdiff_t>(slot) * compact_stride);
      h += static_cast<std::ptrdiff_t>(count) * landmark_block<V>::row;
    }
  }

  /// V numbers and none more: the next slot may be another thread's.
  TURBOMAP_HD static void store_column(A* to, const pack<A, column_lanes<V>>& column) {
    A lanes[column_lanes<V>];
    column.store(lanes);
    for (int i = 0; i < V; ++i) to[i] = lanes[i];
  }

  /// A direction whose pivot is lost in the rounding of A is left alone: a landmark seen once, hardly damped.
  TURBOMAP_HD void factorise(const double (&h)[9], bool moves, eliminated_landmark& e) const {
    const double noise = 16 * detail::epsilon<A>::value;
    const double a = h[0] + damping(h[0]), d = h[2] + damping(h[2]), f = h[5] + damping(h[5]);
    const double i00 = inverse_root(a, moves ? 0 : a);
    const double l10 = h[1] * i00, l20 = h[3] * i00, p11 = d - l10 * l10;
    const double i11 = inverse_root(p11, moves ? noise * d : p11);
    const double l21 = (h[4] - l20 * l10) * i11, p22 = f - l20 * l20 - l21 * l21;
    const double i22 = inverse_root(p22, moves ? noise * f : p22);
    e.inverse[0] = i00, e.inverse[2] = i11, e.inverse[5] = i22;
    e.inverse[1] = -l10 * i00 * i11;
    e.inverse[4] = -l21 * i11 * i22;
    e.inverse[3] = -(l20 * i00 + l21 * e.inverse[1]) * i22;
  }
  /// 1 / sqrt(x) where x > bound, else 0: without a branch, which would often be guessed wrong.
  TURBOMAP_HD static double inverse_root(double x, double bound) {
    const pack<double, 2> root = sqrt(pack<double, 2>(larger(x, 1e-300)));
    double lanes[2];
    root.store(lanes);
    return select_greater(x, bound, 1 / lanes[0], 0.0);
  }
};

/// The largest diagonal element of H of each landmark.
template <class Derived, class A>
void launch_scale_landmarks(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s, double* diagonal) {
  for_each_index(derived(policy), s.landmarks, scale_of_landmarks<A>{s, diagonal});
}

/// The sum of b^2 / h of each landmark.
template <class Derived, class A>
void launch_measure_gains(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s, double* gain) {
  for_each_index(derived(policy), s.landmarks, gain_of_landmarks<A>{s, gain});
}

/// Eliminates all landmarks.
template <int V, class Derived, class A>
void launch_eliminate_landmarks(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                                const damping& damping) {
  constexpr int per_index = eliminate_landmarks<A, V>::landmarks_per_index;
  constexpr int each = 2;  // a factor takes as long as two rows
  const int n = (s.landmarks + per_index - 1) / per_index;
  const work_of_landmarks work{s.landmark_row, s.landmarks, per_index, each};
  if constexpr (is_host_accessible_v<memory_of_t<Derived>> && compact_form<A, V, V>)
    if (s.compact) {
      // What stands for a slot where there is none (compact_products.hpp).
      A* beyond = s.eliminated + static_cast<std::ptrdiff_t>(s.landmark_slot[s.landmarks]) * compact_stride;
      for (int i = 0; i < compact_stride; ++i) beyond[i] = A(0);
      return for_each_in_shares(derived(policy), n, work, eliminate_landmarks<A, V, true>{s, damping});
    }
  for_each_in_shares(derived(policy), n, work, eliminate_landmarks<A, V>{s, damping});
}

/// launch_sum_frames() and launch_eliminate_landmarks(), neither of which needs the other.
template <int V, int D, class Derived, class A>
void launch_sum_and_eliminate(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                              const damping& damping) {
  launch_sum_frames<V, D>(derived(policy), s);
  launch_eliminate_landmarks<V>(derived(policy), s, damping);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/eliminate_landmarks.cuh"
#endif
