// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Function objects that linearise a user's own factors of one frame and between two: index = factor.

#include "linearise_factors.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Sizes of what a factor of frames gives, D = unknowns of a frame.
template <int D>
struct frame_block {
  static constexpr int triangle = D * (D + 1) / 2;
  static constexpr int partial = triangle + D;  ///< H (lower triangle) and b of one frame
  static constexpr int square = D * D;          ///< of a pair: d_first^T w d_second, row-major
};

/// A group of frame_factors (second: null) or frame_pair_factors where the policy computes.
template <class Factor, class Kernel>
struct frame_factor_view {
  const std::int32_t* first;
  const std::int32_t* second;
  const typename Factor::row* rows;
  Factor factor;
  Kernel kernel;
  double undefined_chi2;
  int first_cost;     ///< place of its costs
  int first_partial;  ///< place of its partial sums: one a factor of one frame, two of a pair
  int first_square;   ///< place of its squares
};

template <class Frame, class Factor, class Kernel>
struct linearise_frame_factors {
  static constexpr int D = Frame::dof, size = Factor::size;
  using block = frame_block<D>;
  frame_factor_view<Factor, Kernel> group;
  const typename Frame::template state<double>* states;
  double* partial;
  double* square;

  TURBOMAP_HD void operator()(int i) const {
    double e[size], d[2][size * D], rho, w = 0;
    bool defined;
    constexpr int sides = is_pair ? 2 : 1;
    if constexpr (is_pair)
      defined =
          linearise<Frame>(group.factor, states[group.first[i]], states[group.second[i]], group.rows[i], e, d[0], d[1]);
    else
      defined = linearise<Frame>(group.factor, states[group.first[i]], group.rows[i], e, d[0]);
    const double chi2 = defined ? detail::squared_length<size>(e) : 0;
    const bool use = defined && detail::is_finite(chi2);
    if (use) group.kernel(chi2, rho, w);
    for (int side = 0; side < sides; ++side) {
      double* out = partial + static_cast<std::ptrdiff_t>(group.first_partial + sides * i + side) * block::partial;
      for (int k = 0; k < block::partial; ++k) out[k] = 0;
      if (use) detail::add_normal_equations<size>(d[side], e, w, D, out, out + block::triangle);
    }
    if constexpr (is_pair) {
      double* out = square + static_cast<std::ptrdiff_t>(group.first_square + i) * block::square;
      for (int a = 0; a < D; ++a)
        for (int b = 0; b < D; ++b) {
          double x = 0;
          if (use)
            for (int k = 0; k < size; ++k) x += w * d[0][k * D + a] * d[1][k * D + b];
          out[a * D + b] = x;
        }
    }
  }

 private:
  template <class F>
  static auto takes_two(int)
      -> decltype(std::declval<const F&>().residual(std::declval<const typename Frame::template state<double>&>(),
                                                    std::declval<const typename Frame::template state<double>&>(),
                                                    std::declval<const typename F::row&>(), std::declval<double*>()),
                  std::true_type{});
  template <class>
  static std::false_type takes_two(...);

 public:
  static constexpr bool is_pair = decltype(takes_two<Factor>(0))::value;
};

template <class Frame, class Factor, class Kernel>
struct cost_of_frame_factors {
  frame_factor_view<Factor, Kernel> group;
  const typename Frame::template state<double>* states;
  double* cost;
  double* undefined;

  TURBOMAP_HD void operator()(int i) const {
    double e[Factor::size], rho, unused;
    bool defined;
    if constexpr (linearise_frame_factors<Frame, Factor, Kernel>::is_pair)
      defined = group.factor.residual(states[group.first[i]], states[group.second[i]], group.rows[i], e);
    else
      defined = group.factor.residual(states[group.first[i]], group.rows[i], e);
    group.kernel(defined ? detail::squared_length<Factor::size>(e) : group.undefined_chi2, rho, unused);
    cost[group.first_cost + i] = rho;
    undefined[group.first_cost + i] = defined ? 0 : 1;
  }
};

TURBOMAP_END_NAMESPACE
