// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Residuals of the user's own factors with their derivatives: the factor's linearise() where it has one, else dual numbers
/// through its residual(); and what the normal equations get of them.

#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../math/dual.hpp"
#include "../math/functions.hpp"
#include "../types.hpp"

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

/// Whether n numbers are finite.
TURBOMAP_HD inline bool all_finite(const double* x, int n) {
  for (int i = 0; i < n; ++i)
    if (!is_finite(x[i])) return false;
  return true;
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

TURBOMAP_END_NAMESPACE
