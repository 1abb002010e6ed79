// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The steps of the landmarks from those of the frames (back-substitution), and what the quadratic model of the cost
/// promises of them.

#include <cstddef>

#include "../config.hpp"
#include "../math/pack_convert.hpp"
#include "../parallel.hpp"
#include "compact_columns.hpp"
#include "damping.hpp"
#include "equal_shares.hpp"
#include "move_frames.hpp"
#include "schur_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = some landmarks: their steps from those of the frames, their new positions, and sums of the step.
/// \tparam Compact  columns are in compact form, steps those of turn_steps()
template <class A, int V, int D, bool Compact = false>
struct substitute_landmarks {
  static constexpr int landmarks_per_index = 16;  ///< landmarks that one thread takes
  schur_view<A> s;                                ///< landmarks and lists
  const double* step;                             ///< of the free frames, D each
  turbomap::damping damping;                      ///< as in the elimination
  const double* from;                             ///< [landmark] landmark_stride numbers: positions before the step
  double* to;                                     ///< [landmark] landmark_stride numbers: positions after it
  double* predicted;  ///< [index] sum of dx (damping dx + b): the decrease a quadratic cost would have

  /// The landmarks of index i.
  TURBOMAP_HD void operator()(int i) const {
    double gain = 0;
    const int end = (i + 1) * landmarks_per_index < s.landmarks ? (i + 1) * landmarks_per_index : s.landmarks;
    for (int l = i * landmarks_per_index; l < end; ++l) {
      const eliminated_landmark& e = s.landmark[l];
      double y[3] = {e.c[0], e.c[1], e.c[2]};
      if constexpr (Compact)
        subtract_turned(s.landmark_slot[l], s.landmark_slot[l + 1], y);
      else
        subtract_steps(s.landmark_slot[l], s.landmark_slot[l + 1], y);
      double held[3] = {damping.lambda, damping.lambda, damping.lambda};
      if (damping.scaled) {
        double h[9];
        detail::sum_rows(s, l, h);
        held[0] = damping(h[0]), held[1] = damping(h[2]), held[2] = damping(h[5]);
      }
      move(l, y, held, gain);
    }
    predicted[i] = gain;
  }

  /// y -= Z^T x of some slots: four unknowns of a frame at once where there are vectors, the others one by one.
  TURBOMAP_HD void subtract_steps(int slot, int end, double (&y)[3]) const {
    using P = pack<double, 4>;
    constexpr int wide = TURBOMAP_VECTOR_BYTES > 0 && V >= 4 ? 4 : 0;
    P four[3] = {P(0.0), P(0.0), P(0.0)};
    for (; slot < end; ++slot) {
      const A* z = s.eliminated + static_cast<std::ptrdiff_t>(slot) * 3 * V;
      const double* x = step + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * D;
      if constexpr (wide > 0) {
        const P first = P::load(x);
        for (int m = 0; m < 3; ++m)
          four[m] = multiply_add(convert<double>(pack<A, 4>::load(z + m * V)), first, four[m]);
      }
      for (int m = 0; m < 3; ++m)
        for (int v = wide; v < V; ++v) y[m] -= static_cast<double>(z[m * V + v]) * x[v];
    }
    if constexpr (wide > 0)
      for (int m = 0; m < 3; ++m) y[m] -= sum(four[m]);
  }

  /// The same of compact columns: y -= K^T (v + omega x q), all in the axes of the world.
  TURBOMAP_HD void subtract_turned(int slot, int end, double (&y)[3]) const {
    using P = pack<double, 4>;
    P total[3] = {P(0.0), P(0.0), P(0.0)};
    for (; slot < end; ++slot) {
      const A* k = s.eliminated + static_cast<std::ptrdiff_t>(slot) * compact_stride;
      const double* x = step + static_cast<std::ptrdiff_t>(s.slot_frame[slot]) * turned_stride;
      P g = P::load(x);
      for (int m = 0; m < 3; ++m) g = multiply_add(P(static_cast<double>(k[4 * m + 3])), P::load(x + 4 + 4 * m), g);
      for (int m = 0; m < 3; ++m) total[m] = multiply_add(convert<double>(pack<A, 4>::load(k + 4 * m)), g, total[m]);
    }
    for (int m = 0; m < 3; ++m) y[m] -= sum(total[m]);
  }

  /// Moves landmark l. \param y  its L^-1 b - Z^T x   \param held  damping of its coordinates   \param gain  added to
  TURBOMAP_HD void move(int l, const double (&y)[3], const double (&held)[3], double& gain) const {
    const eliminated_landmark& e = s.landmark[l];
    const double dx[3] = {e.inverse[0] * y[0] + e.inverse[1] * y[1] + e.inverse[3] * y[2],
                          e.inverse[2] * y[1] + e.inverse[4] * y[2], e.inverse[5] * y[2]};
    for (int k = 0; k < 3; ++k) {
      to[l * landmark_stride + k] = from[l * landmark_stride + k] + dx[k];
      gain += dx[k] * (held[k] * dx[k] + e.b[k]);
    }
    to[l * landmark_stride + 3] = 0;  // copied to the host with the others
  }
};

/// How many numbers launch_substitute_landmarks() gives through `predicted`.
inline int landmark_gain_count(int landmarks) {
  constexpr int per_index = substitute_landmarks<double, 6, 6>::landmarks_per_index;
  return (landmarks + per_index - 1) / per_index;
}

/// \param step       of the free frames, D each
/// \param from,to   positions before and after
/// \param predicted  [landmark_gain_count] parts of the decrease that the model promises
template <int V, int D, class Derived, class A>
void launch_substitute_landmarks(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s,
                                 const double* step, const damping& damping, const double* from, double* to,
                                 double* predicted) {
  constexpr int each = 1;  // moving a landmark takes about as long as one of its slots
  const int n = landmark_gain_count(s.landmarks);
  const work_of_landmarks work{s.landmark_slot, s.landmarks, substitute_landmarks<A, V, D>::landmarks_per_index, each};
  if constexpr (is_host_accessible_v<memory_of_t<Derived>> && compact_form<A, V, D>)
    if (s.compact) {
      turn_steps<V>(s, step, s.turned);
      return for_each_in_shares(derived(policy), n, work,
                                substitute_landmarks<A, V, D, true>{s, s.turned, damping, from, to, predicted});
    }
  for_each_in_shares(derived(policy), n, work, substitute_landmarks<A, V, D>{s, step, damping, from, to, predicted});
}

/// Applies a step to all landmarks and frames: launch_substitute_landmarks() and launch_retract_frames().
/// \param frames  how many there are, fixed ones too
template <int V, int D, class Frame, class Derived, class A>
void launch_take_step(const thrust::execution_policy<Derived>& policy, const schur_view<A>& s, const double* step,
                      const damping& damping, int frames, const estimate_view<Frame>& from,
                      const estimate_view<Frame>& to, double* predicted) {
  launch_substitute_landmarks<V, D>(derived(policy), s, step, damping, from.landmarks, to.landmarks, predicted);
  launch_retract_frames(derived(policy), frames, s.free_of_frame, step, from, to);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/substitute_landmarks.cuh"
#endif
