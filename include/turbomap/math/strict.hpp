// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Arithmetic that decides: `strict<T>` rounds every operation to nearest and is never contracted, reassociated or
/// otherwise rewritten, whatever flags the including program is compiled with, on the host and on the device. Geometry
/// whose outcome accepts or rejects something is computed in it, so that all execution policies decide alike.

#include <cmath>
#include <type_traits>

#include "../config.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Hides a value from the optimiser: what was computed so far is rounded, and cannot be fused with what follows.
template <class T>
TURBOMAP_HD inline T rounded(T value) {
#if !defined(__CUDA_ARCH__)
#if defined(__x86_64__) || defined(_M_X64)
  __asm__("" : "+x"(value));
#elif defined(__aarch64__)
  __asm__("" : "+w"(value));
#else
  volatile T kept = value;
  value = kept;
#endif
#endif
  return value;
}

#if defined(__CUDA_ARCH__)
__device__ inline double mul_rn(double a, double b) { return __dmul_rn(a, b); }
__device__ inline double add_rn(double a, double b) { return __dadd_rn(a, b); }
__device__ inline double div_rn(double a, double b) { return __ddiv_rn(a, b); }
__device__ inline double sqrt_rn(double a) { return __dsqrt_rn(a); }
__device__ inline float mul_rn(float a, float b) { return __fmul_rn(a, b); }
__device__ inline float add_rn(float a, float b) { return __fadd_rn(a, b); }
__device__ inline float div_rn(float a, float b) { return __fdiv_rn(a, b); }
__device__ inline float sqrt_rn(float a) { return __fsqrt_rn(a); }
#else
template <class T>
inline T mul_rn(T a, T b) {
  return rounded(a * b);
}
template <class T>
inline T add_rn(T a, T b) {
  return rounded(a + b);
}
template <class T>
inline T div_rn(T a, T b) {
  return rounded(a / rounded(b));  // the divisor is hidden, or -ffast-math would multiply by its reciprocal
}
template <class T>
inline T sqrt_rn(T a) {
  return rounded(std::sqrt(rounded(a)));
}
#endif

}  // namespace detail

/// A floating-point number whose arithmetic is exactly IEEE-754 round to nearest, operation by operation.
template <class T>
struct strict {
  T value;  ///< the number

  strict() = default;
  /// From T, as it is.
  TURBOMAP_HD constexpr strict(T v) : value(v) {}
  /// From another arithmetic type, converted to T.
  template <class U, class = std::enable_if_t<std::is_arithmetic_v<U> && !std::is_same_v<U, T>>>
  TURBOMAP_HD constexpr strict(U v) : value(static_cast<T>(v)) {}
  /// The number.
  TURBOMAP_HD constexpr explicit operator T() const { return value; }

  /// @{
  /// Rounded to nearest, nothing fused.
  TURBOMAP_HD friend strict operator+(strict a, strict b) { return detail::add_rn(a.value, b.value); }
  TURBOMAP_HD friend strict operator-(strict a, strict b) { return detail::add_rn(a.value, -b.value); }
  TURBOMAP_HD friend strict operator*(strict a, strict b) { return detail::mul_rn(a.value, b.value); }
  TURBOMAP_HD friend strict operator/(strict a, strict b) { return detail::div_rn(a.value, b.value); }
  TURBOMAP_HD friend strict operator-(strict a) { return strict(-a.value); }
  TURBOMAP_HD strict& operator+=(strict b) { return *this = *this + b; }
  TURBOMAP_HD strict& operator-=(strict b) { return *this = *this - b; }
  TURBOMAP_HD strict& operator*=(strict b) { return *this = *this * b; }
  TURBOMAP_HD strict& operator/=(strict b) { return *this = *this / b; }
  /// @}

  /// @{
  /// Compares the numbers, as IEEE-754 does.
  TURBOMAP_HD friend bool operator<(strict a, strict b) { return a.value < b.value; }
  TURBOMAP_HD friend bool operator>(strict a, strict b) { return a.value > b.value; }
  TURBOMAP_HD friend bool operator<=(strict a, strict b) { return a.value <= b.value; }
  TURBOMAP_HD friend bool operator>=(strict a, strict b) { return a.value >= b.value; }
  TURBOMAP_HD friend bool operator==(strict a, strict b) { return a.value == b.value; }
  TURBOMAP_HD friend bool operator!=(strict a, strict b) { return a.value != b.value; }
  /// @}
};

/// What geometry is computed in where it accepts or rejects.
using decision = strict<double>;

/// Square root, correctly rounded.
template <class T>
TURBOMAP_HD strict<T> sqrt(strict<T> a) {
  return strict<T>(detail::sqrt_rn(a.value));
}

/// Absolute value.
template <class T>
TURBOMAP_HD strict<T> abs(strict<T> a) {
  return a.value < T(0) ? -a : a;
}

TURBOMAP_END_NAMESPACE
