// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Linearises the user's own factors with landmarks, and sums their robust cost.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../parallel.hpp"
#include "factor_derivatives.hpp"
#include "factor_sums.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A group of landmark_factors where the policy computes, in the order of its structure.
template <class Factor, class Kernel>
struct landmark_factor_view {
  const observation_chunk* chunks;   ///< observations of one frame each
  const std::int32_t* landmark;      ///< [entry] landmark
  const std::int32_t* row;           ///< [entry] place in the order by landmark
  const std::int32_t* coupling;      ///< [entry] place among the couplings; -1: fixed frame
  const typename Factor::row* rows;  ///< [entry] what differs between observations
  Factor factor;                     ///< the residual
  Kernel kernel;                     ///< of its chi2
  double undefined_chi2;             ///< chi2 where the residual is not defined
  int first_chunk;                   ///< number of its first chunk among those of all groups
  int chunk_count;                   ///< chunks

  /// The landmark of entry i: world, m.
  TURBOMAP_HD vec3<double> point(const double* landmarks, int i) const {
    const double* p = landmarks + static_cast<std::ptrdiff_t>(landmark[i]) * landmark_stride;
    return {p[0], p[1], p[2]};
  }
};

/// Index = chunk.
template <class Frame, class Factor, class Kernel, class A>
struct linearise_landmark_factors {
  static constexpr int V = Frame::landmark_dof;          ///< unknowns that it depends on
  static constexpr int size = Factor::size;              ///< numbers of a residual
  using block = landmark_block<V>;                       ///< sizes of the sums
  landmark_factor_view<Factor, Kernel> group;            ///< the factors
  const typename Frame::template state<double>* states;  ///< [frame]
  const double* landmarks;                               ///< [landmark] landmark_stride numbers
  factor_sums<A> sums;                                   ///< where sums are written

  /// One chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    double total[block::partial] = {};
    for (int i = c.begin; i < c.begin + c.count; ++i) {
      double e[size], d_frame[size * V], d_landmark[size * 3], rho, w = 0, h[block::row] = {};
      const bool defined = linearise<Frame>(group.factor, states[c.frame], group.point(landmarks, i), group.rows[i], e,
                                            d_frame, d_landmark);
      const double chi2 = defined ? detail::squared_length<size>(e) : 0;
      if (defined && detail::is_finite(chi2) && detail::all_finite(d_frame, size * V) &&
          detail::all_finite(d_landmark, size * 3)) {
        group.kernel(chi2, rho, w);
        detail::add_normal_equations<size>(d_landmark, e, w, 3, h, h + 6);
        if (c.free >= 0) detail::add_normal_equations<size>(d_frame, e, w, V, total, total + block::triangle);
      }
      for (int k = 0; k < block::row; ++k)
        sums.row[static_cast<std::ptrdiff_t>(group.row[i]) * block::row + k] = static_cast<A>(h[k]);
      if (c.free < 0) continue;
      A* coupling = sums.coupling + static_cast<std::ptrdiff_t>(group.coupling[i]) * block::coupling;
      for (int k = 0; k < 3; ++k)
        for (int v = 0; v < V; ++v) {
          double x = 0;
          if (w > 0)
            for (int m = 0; m < size; ++m) x += w * d_frame[m * V + v] * d_landmark[m * 3 + k];
          coupling[k * V + v] = static_cast<A>(x);
        }
    }
    if (c.free < 0) return;
    double* out = sums.chunk_partial + static_cast<std::ptrdiff_t>(group.first_chunk + chunk) * block::partial;
    for (int k = 0; k < block::partial; ++k) out[k] = total[k];
  }
};

/// Index = chunk: its robust cost, or chi2 of each entry, or both.
template <class Frame, class Factor, class Kernel>
struct cost_of_landmark_factors {
  landmark_factor_view<Factor, Kernel> group;            ///< the factors
  const typename Frame::template state<double>* states;  ///< [frame]
  const double* landmarks;                               ///< [landmark] landmark_stride numbers
  cost_sums sums;                                        ///< may be null
  double* chi2;                                          ///< [entry]; may be null

  /// One chunk.
  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    double total = 0, missing = 0, rho, unused;
    for (int i = c.begin; i < c.begin + c.count; ++i) {
      double e[Factor::size];
      const bool defined = group.factor.residual(states[c.frame], group.point(landmarks, i), group.rows[i], e);
      const double s = defined ? detail::squared_length<Factor::size>(e) : group.undefined_chi2;
      group.kernel(s, rho, unused);
      total += rho, missing += defined ? 0 : 1;
      if (chi2 != nullptr) chi2[i] = s;
    }
    if (sums.cost == nullptr) return;
    sums.cost[group.first_chunk + chunk] = total;
    sums.undefined[group.first_chunk + chunk] = missing;
  }
};

/// Linearises all chunks of a group.
template <class Frame, class Derived, class Factor, class Kernel, class A>
void launch_linearise_landmark_factors(const thrust::execution_policy<Derived>& policy,
                                       const landmark_factor_view<Factor, Kernel>& group, const estimate_view<Frame>& x,
                                       const factor_sums<A>& sums) {
  for_each_index(derived(policy), group.chunk_count,
                 linearise_landmark_factors<Frame, Factor, Kernel, A>{group, x.states, x.landmarks, sums});
}

/// \param sums  of costs; null pointers: not asked for  \param chi2  [entry]; null: not asked for
template <class Frame, class Derived, class Factor, class Kernel>
void launch_evaluate_landmark_factors(const thrust::execution_policy<Derived>& policy,
                                      const landmark_factor_view<Factor, Kernel>& group, const estimate_view<Frame>& x,
                                      const cost_sums& sums, double* chi2) {
  for_each_index(derived(policy), group.chunk_count,
                 cost_of_landmark_factors<Frame, Factor, Kernel>{group, x.states, x.landmarks, sums, chi2});
}

TURBOMAP_END_NAMESPACE
