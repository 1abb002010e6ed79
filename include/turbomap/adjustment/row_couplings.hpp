// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Couplings of reprojections made of their rows. A reprojection depends on frame and landmark through the point X in body
/// coordinates alone: the landmark moves it by R dx, the frame by omega x X + v. So with the landmark's block H of the
/// observation, which is in its row, the coupling is ([X]x R; R) H: 9 numbers are written per observation, not 27.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/pack_convert.hpp"
#include "../parallel.hpp"
#include "factor_sums.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = frame: the columns of its rotation, as packs of couplings need them, and its centre.
template <class A, int V>
struct prepare_axes {
  static_assert(V >= 6,
                "turbomap: couplings are made of rows where a frame's first six unknowns are those of its pose");
  static constexpr int lanes = column_lanes<V>;  ///< numbers of a column
  const std::int32_t* free_of_frame;             ///< [frame] number among the free frames; -1: fixed
  const isometry<double>* T_bw;                  ///< [frame] world to body
  const std::uint32_t* held;                     ///< [free frame] bit i: unknown i stays; null: none
  A* axes;          ///< [free frame] (R; 0) and (0; R), column by column of `lanes` numbers
  double* centres;  ///< [free frame] landmark_stride numbers

  /// One frame.
  TURBOMAP_HD void operator()(int frame) const {
    const std::ptrdiff_t f = free_of_frame[frame];
    if (f < 0) return;
    const isometry<double>& T = T_bw[frame];
    const std::uint32_t mask = held == nullptr ? 0 : held[f];
    A* to = axes + f * 6 * lanes;
    for (int i = 0; i < 6 * lanes; ++i) to[i] = A(0);
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 3; ++row) {
        const A x = static_cast<A>(T.R(row, column));
        if ((mask >> row & 1U) == 0) to[column * lanes + row] = x;
        if ((mask >> (3 + row) & 1U) == 0) to[(3 + column) * lanes + 3 + row] = x;
      }
    const vec3<double> c = transpose(T.R) * T.t;
    double* centre = centres + f * landmark_stride;
    centre[0] = -c.x, centre[1] = -c.y, centre[2] = -c.z, centre[3] = 0;
  }
};

/// H of a landmark by the observations of one frame, lower triangle. \param h  rows of theirs   \param all  room for the sum
template <class A>
[[gnu::always_inline]] TURBOMAP_HD inline const A* sum_of_rows(const A* h, int count, A (&all)[6]) {
  if (count <= 1) return h;
  constexpr int row = landmark_block<6>::row;  // a rig that sees it more than once
  for (int i = 0; i < 6; ++i) all[i] = h[i];
  for (int k = 1; k < count; ++k)
    for (int i = 0; i < 6; ++i) all[i] += h[k * row + i];
  return all;
}

/// The coupling of a frame with a landmark.
/// \param row    first of its rows, in the order of slots   \param count  how many there are
/// \param p      position of the landmark   \param column  the result; lanes beyond V are 0
template <int V, class A>
[[gnu::always_inline]] TURBOMAP_HD inline void make_coupling(const schur_view<A>& s, int frame, int row, int count,
                                                             const double* p, pack<A, column_lanes<V>> (&column)[3]) {
  using P = pack<A, column_lanes<V>>;
  using Q = pack<double, landmark_stride>;
  A all[6];
  const A* h = sum_of_rows(s.sums.row + static_cast<std::ptrdiff_t>(row) * landmark_block<V>::row, count, all);
  A at[landmark_stride], back[landmark_stride];  // from the centre of the frame, and the other way
  const auto q = convert<A>(Q::load(p) - Q::load(s.centres + static_cast<std::ptrdiff_t>(frame) * landmark_stride));
  q.store(at), (-q).store(back);
  const A* axes = s.axes + static_cast<std::ptrdiff_t>(frame) * 6 * column_lanes<V>;
  const auto axis = [axes](int i) { return P::load(axes + i * column_lanes<V>); };
  const P R0 = axis(0), R1 = axis(1), R2 = axis(2);  // [X]x R = R [p - centre]x
  const P d0 = multiply_add(P(at[2]), R1, multiply_add(P(back[1]), R2, axis(3)));
  const P d1 = multiply_add(P(at[0]), R2, multiply_add(P(back[2]), R0, axis(4)));
  const P d2 = multiply_add(P(at[1]), R0, multiply_add(P(back[0]), R1, axis(5)));
  column[0] = multiply_add(d0, P(h[0]), multiply_add(d1, P(h[1]), d2 * P(h[3])));
  column[1] = multiply_add(d0, P(h[1]), multiply_add(d1, P(h[2]), d2 * P(h[4])));
  column[2] = multiply_add(d0, P(h[3]), multiply_add(d1, P(h[4]), d2 * P(h[5])));
}

/// What make_coupling() reads of the frames. \param held  [free frame]; null: none
template <int V, class Derived, class A>
void launch_prepare_axes(const thrust::execution_policy<Derived>& policy, int frames, const std::int32_t* free_of_frame,
                         const isometry<double>* T_bw, const std::uint32_t* held, A* axes, double* centres) {
  for_each_index(derived(policy), frames, prepare_axes<A, V>{free_of_frame, T_bw, held, axes, centres});
}

TURBOMAP_END_NAMESPACE
