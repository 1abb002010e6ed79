// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Linearises the user's own factors of one frame and between two, and sums their robust cost.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../parallel.hpp"
#include "factor_derivatives.hpp"
#include "factor_sums.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A group of frame_factors (second: null) or frame_pair_factors where the policy computes.
template <class Factor, class Kernel>
struct frame_factor_view {
  const std::int32_t* first;         ///< [factor] the frame, or the first one
  const std::int32_t* second;        ///< [factor] the second frame; null: factors of one frame
  const typename Factor::row* rows;  ///< [factor] what differs between factors
  Factor factor;                     ///< the residual
  Kernel kernel;                     ///< of its chi2
  double undefined_chi2;             ///< chi2 where the residual is not defined
  group_place place;                 ///< partial sums: one per factor of one frame, two per factor of a pair
  int count;                         ///< factors
};

/// Index = factor. \tparam Pair  factors between two frames
template <bool Pair, class Frame, class Factor, class Kernel>
struct linearise_frame_factors {
  static constexpr int D = Frame::dof;                   ///< unknowns of a frame
  static constexpr int size = Factor::size;              ///< numbers of a residual
  using block = frame_block<D>;                          ///< sizes of the sums
  frame_factor_view<Factor, Kernel> group;               ///< the factors
  const typename Frame::template state<double>* states;  ///< [frame]
  double* partial;                                       ///< of all groups
  double* square;                                        ///< of all groups

  static constexpr int sides = Pair ? 2 : 1;  ///< frames of a factor

  /// Residuals of factor i and their derivatives by each frame. False: not defined.
  TURBOMAP_HD bool derivatives(int i, double* e, double (*d)[size * D]) const {
    if constexpr (Pair)
      return linearise<Frame>(group.factor, states[group.first[i]], states[group.second[i]], group.rows[i], e, d[0],
                              d[1]);
    else
      return linearise<Frame>(group.factor, states[group.first[i]], group.rows[i], e, d[0]);
  }
  /// Where the sums of a side of factor i are.
  TURBOMAP_HD double* partial_of(int i, int side) const {
    return partial + static_cast<std::ptrdiff_t>(group.place.first_factor_partial + sides * i + side) * block::partial;
  }
  /// Where the sum of a pair of frames of factor i is.
  TURBOMAP_HD double* square_of(int i) const {
    return square + static_cast<std::ptrdiff_t>(group.place.first_square + i) * block::square;
  }

  /// Factor i.
  TURBOMAP_HD void operator()(int i) const {
    double e[size], d[2][size * D], rho, w = 0;
    const bool defined = derivatives(i, e, d);
    const double chi2 = defined ? detail::squared_length<size>(e) : 0;
    bool use = defined && detail::is_finite(chi2);
    for (int side = 0; side < sides; ++side) use = use && detail::all_finite(d[side], size * D);
    if (use) group.kernel(chi2, rho, w);
    for (int side = 0; side < sides; ++side) {
      double* out = partial_of(i, side);
      for (int k = 0; k < block::partial; ++k) out[k] = 0;
      if (use) detail::add_normal_equations<size>(d[side], e, w, D, out, out + block::triangle);
    }
    if constexpr (Pair) {
      double* out = square_of(i);
      for (int a = 0; a < D; ++a)
        for (int b = 0; b < D; ++b) {
          double x = 0;
          if (use)
            for (int k = 0; k < size; ++k) x += w * d[0][k * D + a] * d[1][k * D + b];
          out[a * D + b] = x;
        }
    }
  }
};

/// Index = factor. \tparam Pair  factors between two frames
template <bool Pair, class Frame, class Factor, class Kernel>
struct cost_of_frame_factors {
  frame_factor_view<Factor, Kernel> group;               ///< the factors
  const typename Frame::template state<double>* states;  ///< [frame]
  cost_sums sums;                                        ///< where costs are written

  /// Factor i.
  TURBOMAP_HD void operator()(int i) const {
    double e[Factor::size], rho, unused;
    bool defined;
    if constexpr (Pair)
      defined = group.factor.residual(states[group.first[i]], states[group.second[i]], group.rows[i], e);
    else
      defined = group.factor.residual(states[group.first[i]], group.rows[i], e);
    group.kernel(defined ? detail::squared_length<Factor::size>(e) : group.undefined_chi2, rho, unused);
    sums.cost[group.place.first_cost + i] = rho;
    sums.undefined[group.place.first_cost + i] = defined ? 0 : 1;
  }
};

/// Linearises all factors of a group.
template <bool Pair, class Frame, class Derived, class Factor, class Kernel>
void launch_linearise_frame_factors(const thrust::execution_policy<Derived>& policy,
                                    const frame_factor_view<Factor, Kernel>& group, const estimate_view<Frame>& x,
                                    double* partial, double* square) {
  for_each_index(derived(policy), group.count,
                 linearise_frame_factors<Pair, Frame, Factor, Kernel>{group, x.states, partial, square});
}

/// Writes the robust cost of all factors of a group.
template <bool Pair, class Frame, class Derived, class Factor, class Kernel>
void launch_evaluate_frame_factors(const thrust::execution_policy<Derived>& policy,
                                   const frame_factor_view<Factor, Kernel>& group, const estimate_view<Frame>& x,
                                   const cost_sums& sums) {
  for_each_index(derived(policy), group.count,
                 cost_of_frame_factors<Pair, Frame, Factor, Kernel>{group, x.states, sums});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/linearise_frame_factors.cuh"
#endif
