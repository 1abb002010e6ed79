// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Products of compact columns: what the landmarks that two frames share take from their block of the reduced matrix. All these
/// landmarks share the rotations of the frames, and their two q differ by the step between the two centres. So a block is
/// made of four sums of 3x3 matrices: K K'^T, with [q]x on its left, its right, both or neither. Pairs of slots are summed several
/// at once, a lane each.

#include <cstddef>
#include <type_traits>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/pack_convert.hpp"
#include "compact_columns.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Pairs of slots that are summed at once: the lanes of an AVX2 vector, and as many where vectors are shorter, so that sums
/// have one order.
template <class A>
inline constexpr int pair_lanes = TURBOMAP_VECTOR_BYTES > 0 ? 32 / static_cast<int>(sizeof(A)) : 1;

/// Sums over pairs of slots of two frames that see the same landmark, lane by lane.
/// \tparam Same  both slots are one: what follows by symmetry is left out
template <class A, bool Same>
struct pair_sums {
  using P = pack<A, pair_lanes<A>>;  ///< a number of each pair
  P M[9];                            ///< K K'^T, row by row
  P X[9];                            ///< [q]x K K'^T
  P Y[9];                            ///< K K'^T [q]x^T
  P W[9];                            ///< [q]x K K'^T [q]x^T
  P right[6];                        ///< with Same: ([q]x; I) K c

  TURBOMAP_HD pair_sums() {
    for (int i = 0; i < 9; ++i) M[i] = X[i] = Y[i] = W[i] = P(A(0));
    for (int i = 0; i < 6; ++i) right[i] = P(A(0));
  }

  /// Adds a pair per lane. \param k,other  K and q of the first slot, K of the second
  template <int N>
  [[gnu::always_inline]] TURBOMAP_HD void add(const P (&k)[N], const P (&other)[N]) {
    const P x = k[3], y = k[7], z = k[11];
    for (int j = 0; j < 3; ++j) {
      P m[3];
      for (int i = 0; i < 3; ++i)
        m[i] = multiply_add(k[i], other[j], multiply_add(k[4 + i], other[4 + j], k[8 + i] * other[8 + j]));
      const P n[3] = {multiply_add(y, m[2], -(z * m[1])), multiply_add(z, m[0], -(x * m[2])),
                      multiply_add(x, m[1], -(y * m[0]))};
      // Column j of a matrix B is in two columns of B [q]x^T.
      const int up = (j + 1) % 3, down = (j + 2) % 3;
      const P by_up = j == 0 ? z : j == 1 ? x : y, by_down = -(j == 0 ? y : j == 1 ? z : x);
      for (int i = 0; i < 3; ++i) {
        if (!Same || i >= j) M[3 * i + j] = M[3 * i + j] + m[i];
        X[3 * i + j] = X[3 * i + j] + n[i];
        if (!Same) Y[3 * i + up] = multiply_add(by_up, m[i], Y[3 * i + up]);
        if (!Same) Y[3 * i + down] = multiply_add(by_down, m[i], Y[3 * i + down]);
        if (!Same || i >= up) W[3 * i + up] = multiply_add(by_up, n[i], W[3 * i + up]);
        if (!Same || i >= down) W[3 * i + down] = multiply_add(by_down, n[i], W[3 * i + down]);
      }
    }
  }
  /// Adds the right hand sides of a slot per lane.
  [[gnu::always_inline]] TURBOMAP_HD void add_right(const P (&k)[compact_stride]) {
    const P x = k[3], y = k[7], z = k[11], *g = k + compact_numbers;
    for (int i = 0; i < 3; ++i) right[3 + i] = right[3 + i] + g[i];
    right[0] = right[0] + multiply_add(y, g[2], -(z * g[1]));
    right[1] = right[1] + multiply_add(z, g[0], -(x * g[2]));
    right[2] = right[2] + multiply_add(x, g[1], -(y * g[0]));
  }
};

namespace detail {

/// Four numbers of several rows as columns.
template <class A, int N>
[[gnu::always_inline]] TURBOMAP_HD inline void load_four(const A* const (&row)[N], int offset, pack<A, N>* column) {
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
  using P = pack<A, N>;
  if constexpr (N == 4 && std::is_same_v<A, double>) {
    __m256d r[4];
    for (int i = 0; i < 4; ++i) r[i] = _mm256_loadu_pd(row[i] + offset);
    transpose(r);
    for (int i = 0; i < 4; ++i) column[i] = P(typename P::vector(r[i]));
    return;
  }
#endif
  for (int k = 0; k < 4; ++k) {
    A lanes[N];
    for (int l = 0; l < N; ++l) lanes[l] = row[l][offset + k];
    column[k] = pack<A, N>::load(lanes);
  }
}

/// The first numbers of rows as columns.
template <int Count, class A, int N>
[[gnu::always_inline]] TURBOMAP_HD inline void load_rows(const A* const (&row)[N], pack<A, N> (&column)[Count]) {
  for (int k = 0; k < Count; k += 4) load_four(row, k, column + k);
}

/// The sums of the lanes of nine packs.
template <class A, int N>
TURBOMAP_HD inline mat3<double> matrix_of_sums(const pack<A, N> (&x)[9]) {
  mat3<double> r;
  for (int i = 0; i < 9; ++i) r.m[i] = static_cast<double>(sum(x[i]));
  return r;
}

/// B [q]x^T.
TURBOMAP_HD inline mat3<double> times_cross_transposed(const mat3<double>& B, const vec3<double>& q) {
  mat3<double> r;
  for (int i = 0; i < 3; ++i) {
    r(i, 0) = B(i, 2) * q.y - B(i, 1) * q.z;
    r(i, 1) = B(i, 0) * q.z - B(i, 2) * q.x;
    r(i, 2) = B(i, 1) * q.x - B(i, 0) * q.y;
  }
  return r;
}

}  // namespace detail

/// Products of the columns that a schur_view holds in compact form.
template <class A, int V>
struct compact_products {
  const schur_view<A>& s;  ///< landmarks and lists

  static constexpr int lanes = pair_lanes<A>;  ///< pairs at once
  static constexpr int ahead = 24;             ///< pairs between asking for memory and reading it
  static constexpr int column_bytes = compact_numbers * static_cast<int>(sizeof(A));  ///< of K and q
  using P = pack<A, lanes>;                                                           ///< a number of each pair

  /// Z Z'^T of two different frames, row by row. \param begin,end  of their pairs
  TURBOMAP_HD void between(int f, int g, int begin, int end, double (&product)[36]) const {
    pair_sums<A, false> sums;
    const int all = s.block_pair[s.blocks];  // the next block's columns are asked for, too
    for (int i = begin; i < end; i += lanes) {
      slot_pair rest[lanes];
      const slot_pair* pairs = s.pairs + i;
      if (i + ahead + lanes <= all)
        for (int l = 0; l < lanes; ++l) {
          prefetch(column(pairs[ahead + l].first), column_bytes);
          prefetch(column(pairs[ahead + l].second), column_bytes);
        }
      if (i + lanes > end) {
        for (int l = 0; l < lanes; ++l) rest[l] = i + l < end ? pairs[l] : slot_pair{nothing(), nothing()};
        pairs = rest;
      }
      const A *first[lanes], *second[lanes];
      for (int l = 0; l < lanes; ++l) first[l] = column(pairs[l].first), second[l] = column(pairs[l].second);
      P k[compact_numbers], other[compact_numbers];
      detail::load_rows(first, k);
      detail::load_rows(second, other);
      sums.add(k, other);
    }
    const double* from = s.centres + static_cast<std::ptrdiff_t>(f) * landmark_stride;
    const double* to = s.centres + static_cast<std::ptrdiff_t>(g) * landmark_stride;
    const vec3<double> step{from[0] - to[0], from[1] - to[1], from[2] - to[2]};  // q of the second frame is q + step
    const mat3<double> M = detail::matrix_of_sums(sums.M), X = detail::matrix_of_sums(sums.X);
    const mat3<double> Y = detail::matrix_of_sums(sums.Y) + detail::times_cross_transposed(M, step);
    const mat3<double> W = detail::matrix_of_sums(sums.W) + detail::times_cross_transposed(X, step);
    turn(f, g, M, X, Y, W, product);
  }

  /// Z Z^T of a frame, row by row, and Z c.
  TURBOMAP_HD void of_frame(int f, double (&product)[36], double (&right)[6]) const {
    pair_sums<A, true> sums;
    const int end = s.frame_slot[f + 1];
    for (int i = s.frame_slot[f]; i < end; i += lanes) {
      const A* row[lanes];
      for (int l = 0; l < lanes; ++l) {
        prefetch(column(s.slot_list[i + l + ahead < end ? i + l + ahead : end - 1]), column_bytes);
        row[l] = column(i + l < end ? s.slot_list[i + l] : nothing());
      }
      P k[compact_stride];
      detail::load_rows(row, k);
      sums.add(k, k);
      sums.add_right(k);
    }
    mat3<double> M = detail::matrix_of_sums(sums.M), W = detail::matrix_of_sums(sums.W);
    const mat3<double> X = detail::matrix_of_sums(sums.X);
    M(0, 1) = M(1, 0), M(0, 2) = M(2, 0), M(1, 2) = M(2, 1);
    W(0, 1) = W(1, 0), W(0, 2) = W(2, 0), W(1, 2) = W(2, 1);
    turn(f, f, M, X, transpose(X), W, product);
    for (int part = 0; part < 2; ++part) {
      double g[3];
      for (int i = 0; i < 3; ++i) g[i] = static_cast<double>(sum(sums.right[3 * part + i]));
      const vec3<double> turned = axes_of<V>(s, f, part) * vec3<double>{g[0], g[1], g[2]};
      right[3 * part] = turned.x, right[3 * part + 1] = turned.y, right[3 * part + 2] = turned.z;
    }
  }

 private:
  TURBOMAP_HD const A* column(int slot) const {
    return s.eliminated + static_cast<std::ptrdiff_t>(slot) * compact_stride;
  }
  /// The slot beyond the others: zeros.
  TURBOMAP_HD int nothing() const { return s.landmark_slot[s.landmarks]; }

  /// From the axes of the world into those of the frames.
  TURBOMAP_HD void turn(int f, int g, const mat3<double>& M, const mat3<double>& X, const mat3<double>& Y,
                        const mat3<double>& W, double (&product)[36]) const {
    const mat3<double> R[2] = {axes_of<V>(s, f, 0), axes_of<V>(s, f, 1)};
    const mat3<double> Q[2] = {transpose(axes_of<V>(s, g, 0)), transpose(axes_of<V>(s, g, 1))};
    const mat3<double>* quarter[2][2] = {{&W, &X}, {&Y, &M}};
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b) {
        const mat3<double> turned = R[a] * *quarter[a][b] * Q[b];
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c) product[(3 * a + r) * 6 + 3 * b + c] = turned(r, c);
      }
  }
};

TURBOMAP_END_NAMESPACE
