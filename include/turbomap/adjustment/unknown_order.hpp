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

TURBOMAP_BEGIN_NAMESPACE

/// Places of unknowns; see above. \tparam V,D  the first V of a frame's D unknowns come last
template <int V, int D>
struct unknown_order {
  int frames;  ///< free frames

  /// Place of an unknown of a frame.
  int place(int frame, int unknown) const {
    return unknown < V ? frames * (D - V) + frame * V + unknown : frame * (D - V) + unknown - V;
  }

  /// The lower triangle, column by column of `stride` numbers, of `from` into `to`.
  void matrix(const double* from, double* to, int stride) const {
    for (int a = 0; a < frames; ++a)
      for (int b = a; b < frames; ++b)
        for (int r = 0; r < D; ++r) {
          const double* row = from + static_cast<std::ptrdiff_t>(a * D + r) * stride + b * D;
          const int p = place(a, r);
          for (int c = a == b ? r : 0; c < D; ++c) {
            const int q = place(b, c);
            to[static_cast<std::ptrdiff_t>(p < q ? p : q) * stride + (p < q ? q : p)] = row[c];
          }
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
};

TURBOMAP_END_NAMESPACE
