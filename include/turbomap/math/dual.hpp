// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Forward-mode dual numbers: a value and its derivatives by N unknowns, through any function template. What
/// derivatives of a user's own residual, and of camera models without a jacobian(), are made with.

#include <cmath>
#include <type_traits>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// a + sum_i d[i] epsilon_i with epsilon_i epsilon_j = 0. Comparisons look at the value alone.
template <int N>
struct dual {
  double a;     ///< the value
  double d[N];  ///< its derivatives by the unknowns

  dual() = default;
  /// A constant: its derivatives are 0.
  template <class T, class = std::enable_if_t<std::is_arithmetic_v<T>>>
  TURBOMAP_HD dual(T value) : a(static_cast<double>(value)) {
    for (int i = 0; i < N; ++i) d[i] = 0;
  }
  /// The unknown number `index` at a value.
  TURBOMAP_HD static dual variable(double value, int index) {
    dual r(value);
    r.d[index] = 1;
    return r;
  }

  /// The value f with f' times the derivatives of x: the chain rule.
  TURBOMAP_HD friend dual chain(const dual& x, double f, double slope) {
    dual r;
    r.a = f;
    for (int i = 0; i < N; ++i) r.d[i] = slope * x.d[i];
    return r;
  }
  /// The same for a function of two variables: f, with derivatives by_x and by_y.
  TURBOMAP_HD friend dual chain(const dual& x, double by_x, const dual& y, double by_y, double f) {
    dual r;
    r.a = f;
    for (int i = 0; i < N; ++i) r.d[i] = by_x * x.d[i] + by_y * y.d[i];
    return r;
  }

  /// @{
  /// Value and derivatives of the operation.
  TURBOMAP_HD friend dual operator+(const dual& x, const dual& y) { return chain(x, 1, y, 1, x.a + y.a); }
  TURBOMAP_HD friend dual operator-(const dual& x, const dual& y) { return chain(x, 1, y, -1, x.a - y.a); }
  TURBOMAP_HD friend dual operator*(const dual& x, const dual& y) { return chain(x, y.a, y, x.a, x.a * y.a); }
  TURBOMAP_HD friend dual operator/(const dual& x, const dual& y) {
    const double f = x.a / y.a;
    return chain(x, 1 / y.a, y, -f / y.a, f);
  }
  TURBOMAP_HD friend dual operator-(const dual& x) { return chain(x, -x.a, -1); }
  TURBOMAP_HD dual& operator+=(const dual& y) { return *this = *this + y; }
  TURBOMAP_HD dual& operator-=(const dual& y) { return *this = *this - y; }
  TURBOMAP_HD dual& operator*=(const dual& y) { return *this = *this * y; }
  TURBOMAP_HD dual& operator/=(const dual& y) { return *this = *this / y; }
  /// @}

  /// @{
  /// Compares the values.
  TURBOMAP_HD friend bool operator<(const dual& x, const dual& y) { return x.a < y.a; }
  TURBOMAP_HD friend bool operator>(const dual& x, const dual& y) { return x.a > y.a; }
  TURBOMAP_HD friend bool operator<=(const dual& x, const dual& y) { return x.a <= y.a; }
  TURBOMAP_HD friend bool operator>=(const dual& x, const dual& y) { return x.a >= y.a; }
  TURBOMAP_HD friend bool operator==(const dual& x, const dual& y) { return x.a == y.a; }
  TURBOMAP_HD friend bool operator!=(const dual& x, const dual& y) { return x.a != y.a; }
  /// @}

  /// @{
  /// Value and derivatives of std's function of this name, for double. Where that has no derivative (the root of 0, asin of
  /// 1), they are infinite or NaN.
  TURBOMAP_HD friend dual sqrt(const dual& x) {
    const double f = ::sqrt(x.a);
    return chain(x, f, 0.5 / f);
  }
  TURBOMAP_HD friend dual sin(const dual& x) { return chain(x, ::sin(x.a), ::cos(x.a)); }
  TURBOMAP_HD friend dual cos(const dual& x) { return chain(x, ::cos(x.a), -::sin(x.a)); }
  TURBOMAP_HD friend dual tan(const dual& x) {
    const double f = ::tan(x.a);
    return chain(x, f, 1 + f * f);
  }
  TURBOMAP_HD friend dual exp(const dual& x) {
    const double f = ::exp(x.a);
    return chain(x, f, f);
  }
  TURBOMAP_HD friend dual log(const dual& x) { return chain(x, ::log(x.a), 1 / x.a); }
  TURBOMAP_HD friend dual asin(const dual& x) { return chain(x, ::asin(x.a), 1 / ::sqrt(1 - x.a * x.a)); }
  TURBOMAP_HD friend dual acos(const dual& x) { return chain(x, ::acos(x.a), -1 / ::sqrt(1 - x.a * x.a)); }
  TURBOMAP_HD friend dual atan(const dual& x) { return chain(x, ::atan(x.a), 1 / (1 + x.a * x.a)); }
  TURBOMAP_HD friend dual atan2(const dual& y, const dual& x) {
    const double n = x.a * x.a + y.a * y.a;
    return chain(y, x.a / n, x, -y.a / n, ::atan2(y.a, x.a));
  }
  TURBOMAP_HD friend dual abs(const dual& x) { return x.a < 0 ? -x : x; }
  TURBOMAP_HD friend dual pow(const dual& x, double exponent) {
    const double slope = exponent == 0 ? 0.0 : exponent * ::pow(x.a, exponent - 1);  // x^0 is 1, also of 0
    return chain(x, ::pow(x.a, exponent), slope);
  }
  /// @}
};

TURBOMAP_END_NAMESPACE
