// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Function objects that linearise a user's own factors, or sum their robust cost: with landmarks (index = chunk), of
/// one
/// frame and between two (index = factor).

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../math/dual.hpp"
#include "linearise_reprojections.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class Factor, class... Arguments>
struct brings_derivative_of {
  template <class F>
  static auto test(int) -> decltype(std::declval<const F&>().linearise(std::declval<Arguments>()...), std::true_type{});
  template <class>
  static std::false_type test(...);
  static constexpr bool value = decltype(test<Factor>(0))::value;
};

/// The state at a step of zero, whose unknowns `first`, `first + 1`, ... are the first `count` of the step.
template <class Frame, class D>
TURBOMAP_HD typename Frame::template state<D> differentiate(const typename Frame::template state<double>& x, int first,
                                                            int count) {
  D step[Frame::dof];
  for (int i = 0; i < Frame::dof; ++i) step[i] = i < count ? D::variable(0, first + i) : D(0);
  return Frame::template retract<D>(x, step);
}

}  // namespace detail

/// Residuals and derivatives of one block with a landmark. False: not defined, or not finite.
template <class Frame, class Factor>
TURBOMAP_HD bool linearise(const Factor& factor, const typename Frame::template state<double>& x, const vec3<double>& X,
                           const typename Factor::row& row, double* e, double* d_frame, double* d_landmark) {
  constexpr int V = Frame::landmark_dof;
  using state = typename Frame::template state<double>;
  if constexpr (detail::brings_derivative_of<Factor, const state&, const vec3<double>&, const typename Factor::row&,
                                             double*, double*, double*>::value) {
    return factor.linearise(x, X, row, e, d_frame, d_landmark);
  } else {
    using D = dual<V + 3>;
    D r[Factor::size];
    const auto moved = detail::differentiate<Frame, D>(x, 0, V);
    const vec3<D> point{D::variable(X.x, V), D::variable(X.y, V + 1), D::variable(X.z, V + 2)};
    if (!factor.residual(moved, point, row, r)) return false;
    for (int k = 0; k < Factor::size; ++k) {
      e[k] = r[k].a;
      for (int i = 0; i < V; ++i) d_frame[k * V + i] = r[k].d[i];
      for (int i = 0; i < 3; ++i) d_landmark[k * 3 + i] = r[k].d[V + i];
    }
    return true;
  }
}

/// The same of one frame.
template <class Frame, class Factor>
TURBOMAP_HD bool linearise(const Factor& factor, const typename Frame::template state<double>& x,
                           const typename Factor::row& row, double* e, double* d_frame) {
  using state = typename Frame::template state<double>;
  if constexpr (detail::brings_derivative_of<Factor, const state&, const typename Factor::row&, double*,
                                             double*>::value) {
    return factor.linearise(x, row, e, d_frame);
  } else {
    using D = dual<Frame::dof>;
    D r[Factor::size];
    if (!factor.residual(detail::differentiate<Frame, D>(x, 0, Frame::dof), row, r)) return false;
    for (int k = 0; k < Factor::size; ++k) {
      e[k] = r[k].a;
      for (int i = 0; i < Frame::dof; ++i) d_frame[k * Frame::dof + i] = r[k].d[i];
    }
    return true;
  }
}

/// The same between two frames.
template <class Frame, class Factor>
TURBOMAP_HD bool linearise(const Factor& factor, const typename Frame::template state<double>& x,
                           const typename Frame::template state<double>& y, const typename Factor::row& row, double* e,
                           double* d_first, double* d_second) {
  constexpr int n = Frame::dof;
  using state = typename Frame::template state<double>;
  if constexpr (detail::brings_derivative_of<Factor, const state&, const state&, const typename Factor::row&, double*,
                                             double*, double*>::value) {
    return factor.linearise(x, y, row, e, d_first, d_second);
  } else {
    using D = dual<2 * n>;
    D r[Factor::size];
    const auto first = detail::differentiate<Frame, D>(x, 0, n), second = detail::differentiate<Frame, D>(y, n, n);
    if (!factor.residual(first, second, row, r)) return false;
    for (int k = 0; k < Factor::size; ++k) {
      e[k] = r[k].a;
      for (int i = 0; i < n; ++i) d_first[k * n + i] = r[k].d[i], d_second[k * n + i] = r[k].d[n + i];
    }
    return true;
  }
}

namespace detail {

template <int Size>
TURBOMAP_HD double squared_length(const double* e) {
  double s = 0;
  for (int k = 0; k < Size; ++k) s += e[k] * e[k];
  return s;
}

/// Adds the lower triangle of d^T w d to H and -d^T w e to b, d of `Size` rows and n columns.
template <int Size>
TURBOMAP_HD void add_normal_equations(const double* d, const double* e, double w, int n, double* H, double* b) {
  for (int i = 0, at = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j, ++at)
      for (int k = 0; k < Size; ++k) H[at] += w * d[k * n + i] * d[k * n + j];
    for (int k = 0; k < Size; ++k) b[i] -= w * d[k * n + i] * e[k];
  }
}

}  // namespace detail

/// A group of landmark_factors where the policy computes, in the order of its structure.
template <class Factor, class Kernel>
struct landmark_factor_view {
  const observation_chunk* chunks;
  const std::int32_t* landmark;
  const std::int32_t* row;
  const std::int32_t* coupling;
  const typename Factor::row* rows;
  Factor factor;
  Kernel kernel;
  double undefined_chi2;
  int first_partial;

  TURBOMAP_HD vec3<double> point(const double* landmarks, int i) const {
    const double* p = landmarks + static_cast<std::ptrdiff_t>(landmark[i]) * landmark_stride;
    return {p[0], p[1], p[2]};
  }
};

template <class Frame, class Factor, class Kernel, class A>
struct linearise_landmark_factors {
  static constexpr int V = Frame::landmark_dof, size = Factor::size;
  using block = landmark_block<V>;
  landmark_factor_view<Factor, Kernel> group;
  const typename Frame::template state<double>* states;
  const double* landmarks;
  landmark_sums<A> sums;

  TURBOMAP_HD void operator()(int chunk) const {
    const observation_chunk& c = group.chunks[chunk];
    double total[block::partial] = {};
    for (int i = c.begin; i < c.begin + c.count; ++i) {
      double e[size], d_frame[size * V], d_landmark[size * 3], rho, w = 0, h[block::row] = {};
      const bool defined = linearise<Frame>(group.factor, states[c.frame], group.point(landmarks, i), group.rows[i], e,
                                            d_frame, d_landmark);
      const double chi2 = defined ? detail::squared_length<size>(e) : 0;
      if (defined && detail::is_finite(chi2)) {
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
    double* out = sums.partial + static_cast<std::ptrdiff_t>(group.first_partial + chunk) * block::partial;
    for (int k = 0; k < block::partial; ++k) out[k] = total[k];
  }
};

template <class Frame, class Factor, class Kernel>
struct cost_of_landmark_factors {
  landmark_factor_view<Factor, Kernel> group;
  const typename Frame::template state<double>* states;
  const double* landmarks;
  double* cost;
  double* undefined;
  double* chi2;  ///< [entry]; may be null

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
    if (cost != nullptr) cost[group.first_partial + chunk] = total;
    if (undefined != nullptr) undefined[group.first_partial + chunk] = missing;
  }
};

TURBOMAP_END_NAMESPACE
