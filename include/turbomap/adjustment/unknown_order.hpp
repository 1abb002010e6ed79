// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The order in which the host solves frames of D unknowns of which landmarks see the first V only, as poses of a keyframe with an
/// IMU: first the D - V others of each frame, then all poses. Velocities and biases join neighbours in time alone, so their rows
/// begin shortly before the diagonal, and those of the poses with the frame before: for 25 frames a fifth of the products of the
/// full matrix.

#include <cstddef>

#include "../config.hpp"
#include "tiled_matrix.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Places of unknowns; see above. \tparam V,D  the first V of a frame's D unknowns come last
template <int V, int D>
struct unknown_order {
  int frames;  ///< free frames

  /// Place of an unknown of a frame.
  int place(int frame, int unknown) const {
    return unknown < V ? frames * (D - V) + frame * V + unknown : frame * (D - V) + unknown - V;
  }

  /// The first `count` unknowns of frames a and b, a <= b, are joined.
  void join(int a, int b, int count, tiled_matrix& matrix) const {
    for (int r = 0; r < count; ++r)
      for (int c = 0; c < count; ++c) matrix.join(place(a, r), place(b, c));
  }
  /// Puts their block there, of which only the upper triangle is read where a == b.
  /// \param from  row-major, `stride` numbers from row to row
  void put(int a, int b, int count, const double* from, std::ptrdiff_t stride, tiled_matrix& matrix) const {
    for (int r = 0; r < count; ++r) {
      const double* const row = from + r * stride;
      const int p = place(a, r), begin = a == b ? r : 0, middle = begin < V ? V : begin;
      put_run(p, place(b, begin), (count < V ? count : V) - begin, row + begin, matrix);
      if (count > middle) put_run(p, place(b, middle), count - middle, row + middle, matrix);
    }
  }
  /// A vector into this order.
  void vector(const double* from, double* to) const {
    for (int f = 0; f < frames; ++f)
      for (int u = 0; u < D; ++u) to[place(f, u)] = from[f * D + u];
  }
  /// A vector back into the order of the frames.
  void restore(const double* from, double* to) const {
    for (int f = 0; f < frames; ++f)
      for (int u = 0; u < D; ++u) to[f * D + u] = from[place(f, u)];
  }

 private:
  /// Elements of place p with places that follow each other from q on, all on one side of p.
  static void put_run(int p, int q, int count, const double* from, tiled_matrix& matrix) {
    for (int c = 0; c < count;) {
      constexpr int tile = tiled_matrix::tile;
      const int left = tile - (q + c) % tile, end = c + left < count ? c + left : count, step = q < p ? tile : 1;
      double* to = q < p ? &matrix.at(p, q + c) : &matrix.at(q + c, p);
      for (; c < end; ++c, to += step) *to = from[c];
    }
  }
};

TURBOMAP_END_NAMESPACE
