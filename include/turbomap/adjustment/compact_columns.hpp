// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Columns of eliminated landmarks in a compact form, on the host. A reprojection depends on frame and landmark through one
/// point, so its coupling is diag(R, R) ([q]x; I) H (row_couplings.hpp), where q leads from the centre of the frame to the
/// landmark. What elimination makes of it is diag(R, R) ([q]x; I) K with K = H L^-T: K and q are kept, 12 numbers instead
/// of 18, and their products are summed in the axes of the world (compact_products.hpp). In float32 the steps of landmarks would
/// lose digits: an adjustment of a hard problem (examples/04) then took twice the iterations.

#include <cstddef>
#include <type_traits>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/pack.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Numbers of a slot: the columns of K, each followed by a coordinate of q, then K c and one that is not read: two lines of the
/// cache.
inline constexpr int compact_stride = 16;
/// Of them, K and q.
inline constexpr int compact_numbers = 12;

/// Whether couplings in numbers of A of frames with D unknowns, of which landmarks see V, have a compact form.
template <class A, int V, int D>
inline constexpr bool compact_form = std::is_same_v<A, double>&& V == 6 && D == 6;

/// A factor as compact columns are made with it: each number in all lanes.
template <class A>
struct compact_factor {
  pack<A, 4> inverse[6];  ///< of L, lower triangle
  pack<A, 4> c[3];        ///< L^-1 b

  /// Of an eliminated landmark.
  TURBOMAP_HD explicit compact_factor(const eliminated_landmark& e) {
    for (int i = 0; i < 6; ++i) inverse[i] = pack<A, 4>(static_cast<A>(e.inverse[i]));
    for (int i = 0; i < 3; ++i) c[i] = pack<A, 4>(static_cast<A>(e.c[i]));
  }
};

/// The column of a slot.
/// \param h         H of the landmark by its observations of that frame, lower triangle
/// \param p,centre  positions of landmark and frame
/// \param to        compact_stride numbers
template <class A>
[[gnu::always_inline]] TURBOMAP_HD inline void make_compact_column(const A* h, const compact_factor<A>& f,
                                                                   const double* p, const double* centre, A* to) {
  using P = pack<A, 4>;
  const int first[4] = {0, 1, 3, 3}, second[4] = {1, 2, 4, 4}, third[4] = {3, 4, 5, 5};
  const P h0 = P::gather(h, first, 1), h1 = P::gather(h, second, 1), h2 = P::gather(h, third, 1);
  const P k0 = h0 * f.inverse[0], k1 = multiply_add(h0, f.inverse[1], h1 * f.inverse[2]);
  const P k2 = multiply_add(h0, f.inverse[3], multiply_add(h1, f.inverse[4], h2 * f.inverse[5]));
  k0.store(to), k1.store(to + 4), k2.store(to + 8);
  multiply_add(k0, f.c[0], multiply_add(k1, f.c[1], k2 * f.c[2])).store(to + 12);
  for (int i = 0; i < 3; ++i) to[4 * i + 3] = static_cast<A>(p[i] - centre[i]);
}

/// Rotation of the first three unknowns of a free frame (part 0) or the last three (1); rows of held ones are 0.
template <int V, class A>
TURBOMAP_HD inline mat3<double> axes_of(const schur_view<A>& s, int f, int part) {
  const A* axes = s.axes + (static_cast<std::ptrdiff_t>(f) * 6 + part * 3) * column_lanes<V> + part * 3;
  mat3<double> R;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      R(row, column) = static_cast<double>(axes[column * column_lanes<V> + row]);
  return R;
}

/// Numbers of a frame that turn_steps() gives.
inline constexpr int turned_stride = 16;

/// Steps (omega, v) of the free frames as back-substitution needs them: R^T v, then (R^T omega) x e for each axis e of the
/// world; 4 numbers each.
template <int V, class A>
TURBOMAP_ONE_BODY void turn_steps(const schur_view<A>& s, const double* step, double* turned) {
  for (int f = 0; f < s.free_frames; ++f) {
    const double* x = step + static_cast<std::ptrdiff_t>(f) * V;
    const vec3<double> w = transpose(axes_of<V>(s, f, 0)) * vec3<double>{x[0], x[1], x[2]};
    const vec3<double> v = transpose(axes_of<V>(s, f, 1)) * vec3<double>{x[3], x[4], x[5]};
    const double rows[turned_stride] = {v.x, v.y, v.z, 0, 0, w.z, -w.y, 0, -w.z, 0, w.x, 0, w.y, -w.x, 0, 0};
    for (int i = 0; i < turned_stride; ++i) turned[static_cast<std::ptrdiff_t>(f) * turned_stride + i] = rows[i];
  }
}

TURBOMAP_END_NAMESPACE
