// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// atan, atan2, sin and cos of strict numbers, made of + - * / and comparisons only: libm and the CUDA math library
/// differ in the last bit, these do not. Generic code writes `using std::atan2; atan2(y, x)`: float and double take
/// std's, strict numbers (and a dual number type) find their own by argument-dependent lookup.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "../config.hpp"
#include "strict.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Names the compiler and target in the types of member templates of plain structs (default argument), so that the
/// linker does not merge versions compiled for different processors.
struct this_target {};

/// Spacing of the floating-point numbers at 1 for the type that S computes in; a tolerance, not a limit of S.
template <class S>
struct epsilon {
  static constexpr double value = 0x1p-52;
};
template <>
struct epsilon<float> {
  static constexpr double value = 0x1p-23;
};
template <class T>
struct epsilon<strict<T>> : epsilon<T> {};

/// The bits of a number: its sign is the uppermost.
TURBOMAP_HD inline std::uint64_t bits_of(double a) {
  std::uint64_t bits;
  std::memcpy(&bits, &a, sizeof bits);
  return bits;
}
/// The same in 32 bits.
TURBOMAP_HD inline std::uint32_t bits_of(float a) {
  std::uint32_t bits;
  std::memcpy(&bits, &a, sizeof bits);
  return bits;
}

/// True for neither infinity nor NaN. Looks at the exponent bits: -ffast-math removes the usual comparisons.
TURBOMAP_HD inline bool is_finite(double a) { return (bits_of(a) & 0x7FF0000000000000u) != 0x7FF0000000000000u; }
TURBOMAP_HD inline bool is_finite(float a) { return (bits_of(a) & 0x7F800000u) != 0x7F800000u; }
template <class T>
TURBOMAP_HD bool is_finite(strict<T> a) {
  return is_finite(a.value);
}
/// Any other scalar, e.g. a dual number: infinity - infinity and NaN - NaN are not zero.
template <class S, class = std::enable_if_t<!std::is_arithmetic_v<S>>>
TURBOMAP_HD bool is_finite(const S& a) {
  return a - a == S(0);
}

/// Each by itself: a sum of finite numbers may overflow.
template <class... Numbers>
TURBOMAP_HD bool each_finite(Numbers... x) {
  return (is_finite(x) && ...);
}

TURBOMAP_HD inline bool is_nan(double a) { return (bits_of(a) << 1) > 0xFFE0000000000000u; }

/// True for a set sign bit, also that of -0.
TURBOMAP_HD inline bool is_negative(double a) { return (bits_of(a) >> 63) != 0; }

/// x - quadrant * pi/2 = r, |r| <= pi/4 (Cody and Waite: pi/2 in three parts whose products with the quadrant are
/// exact). Needs |x| <= 2^20. Returns the quadrant modulo 4.
TURBOMAP_HD inline int reduce_quadrant(strict<double> x, strict<double>& r) {
  using S = strict<double>;
  const S to_integer = 0x1.8p52;  // adding it rounds to an integer
  const S n = (x * S(0x1.45f306dc9c883p-1) + to_integer) - to_integer;
  const S a = x - n * S(0x1.921fb544p0);
  const S b = n * S(0x1.0b4611a6p-34);
  const S head = a - b;
  const S lost = (a - head) - b;
  r = head - (n * S(0x1.3198a2e037073p-69) - lost);
  return static_cast<int>(n.value) & 3;
}

/// first z^n + ... + last, by Horner's rule.
template <class... Numbers>
TURBOMAP_HD strict<double> polynomial(strict<double> z, double first, Numbers... others) {
  strict<double> p(first);
  ((p = p * z + strict<double>(others)), ...);
  return p;
}

/// Taylor series on |r| <= pi/4, truncated below 1e-18 relative.
TURBOMAP_HD inline strict<double> sin_series(strict<double> r) {
  using S = strict<double>;
  const S z = r * r;
  const S p = polynomial(z, 1.0 / 355687428096000.0, -1.0 / 1307674368000.0, 1.0 / 6227020800.0, -1.0 / 39916800.0,
                         1.0 / 362880.0, -1.0 / 5040.0, 1.0 / 120.0, -1.0 / 6.0);
  return r + r * (z * p);
}
TURBOMAP_HD inline strict<double> cos_series(strict<double> r) {
  using S = strict<double>;
  const S z = r * r;
  const S p = polynomial(z, 1.0 / 20922789888000.0, -1.0 / 87178291200.0, 1.0 / 479001600.0, -1.0 / 3628800.0,
                         1.0 / 40320.0, -1.0 / 720.0, 1.0 / 24.0);
  return S(1) + (S(-0.5) * z + z * (z * p));
}

/// atan(low / high) for 0 <= low <= high, 0 < high, both finite: the angle of the nearest k/8, plus the series of the
/// rest.
TURBOMAP_HD inline strict<double> first_octant(strict<double> low, strict<double> high) {
  using S = strict<double>;
  constexpr double atan_of_eighths[9] = {0.0,
                                         0x1.fd5ba9aac2f6ep-4,
                                         0x1.f5b75f92c80ddp-3,
                                         0x1.6f61941e4def1p-2,
                                         0x1.dac670561bb4fp-2,
                                         0x1.1e00babdefeb4p-1,
                                         0x1.4978fa3269ee1p-1,
                                         0x1.700a7c5784634p-1,
                                         0x1.921fb54442d18p-1};
  if (high.value > 0x1p1000) low *= S(0x1p-60), high *= S(0x1p-60);  // the sum below must not overflow
  if (high.value < 0x1p-900) low *= S(0x1p100), high *= S(0x1p100);  // nor its product lose bits
  const int k = static_cast<int>((low / high * S(8) + S(0.5)).value);
  const S c = S(k) * S(0.125);
  const S r = (low - c * high) / (high + c * low);  // tan of a difference; |r| <= 1/16
  const S z = r * r;
  const S p = polynomial(z, 1.0 / 13.0, -1.0 / 11.0, 1.0 / 9.0, -1.0 / 7.0, 1.0 / 5.0, -1.0 / 3.0);
  return S(atan_of_eighths[k]) + (r + r * (z * p));
}

}  // namespace detail

/// Angle of the vector (x, y) in radians, [-pi, pi]; signs of zero and infinities as std::atan2. Within 2 units in the
/// last place, and the same bits on host and device.
TURBOMAP_HD inline strict<double> atan2(strict<double> y, strict<double> x) {
  using S = strict<double>;
  if (detail::is_nan(y.value) || detail::is_nan(x.value)) return x + y;
  const S up = detail::is_negative(y.value) ? -y : y, along = detail::is_negative(x.value) ? -x : x;
  const bool steep = up > along;
  const S low = steep ? along : up, high = steep ? up : along;
  S angle(0);
  if (!detail::is_finite(high))
    angle = detail::is_finite(low) ? 0.0 : 0x1.921fb54442d18p-1;
  else if (high > S(0))
    angle = detail::first_octant(low, high);
  if (steep) angle = (S(0x1.1a62633145c07p-54) - angle) + S(0x1.921fb54442d18p0);
  if (detail::is_negative(x.value)) angle = (S(0x1.1a62633145c07p-53) - angle) + S(0x1.921fb54442d18p1);
  return detail::is_negative(y.value) ? -angle : angle;
}

/// Arc tangent in radians, [-pi/2, pi/2]; as accurate as atan2.
TURBOMAP_HD inline strict<double> atan(strict<double> x) { return atan2(x, strict<double>(1)); }

/// Sine and cosine of x radians, |x| <= 2^20 (NaN beyond: no angle of this library is there). Within 2 units in the
/// last place, and the same bits on host and device.
TURBOMAP_HD inline void sin_cos(strict<double> x, strict<double>& sine, strict<double>& cosine) {
  using S = strict<double>;
  if (!(x >= S(-0x1p20) && x <= S(0x1p20)) || !detail::is_finite(x)) {
    sine = cosine = S(__builtin_nan(""));
    return;
  }
  S r;
  const int quadrant = detail::reduce_quadrant(x, r);
  const S s = detail::sin_series(r), c = detail::cos_series(r);
  sine = (quadrant & 1) != 0 ? c : s;
  cosine = (quadrant & 1) != 0 ? s : c;
  if ((quadrant & 2) != 0) sine = -sine;
  if (quadrant == 1 || quadrant == 2) cosine = -cosine;
}
/// Sine of x radians; as sin_cos().
TURBOMAP_HD inline strict<double> sin(strict<double> x) {
  strict<double> s, c;
  sin_cos(x, s, c);
  return s;
}
/// Cosine of x radians; as sin_cos().
TURBOMAP_HD inline strict<double> cos(strict<double> x) {
  strict<double> s, c;
  sin_cos(x, s, c);
  return c;
}

/// strict<float>: computed in strict<double>, rounded once more.
TURBOMAP_HD inline strict<float> atan2(strict<float> y, strict<float> x) {
  return static_cast<float>(atan2(strict<double>(y.value), strict<double>(x.value)).value);
}
/// Arc tangent; as above.
TURBOMAP_HD inline strict<float> atan(strict<float> x) { return atan2(x, strict<float>(1)); }
/// Sine; as above.
TURBOMAP_HD inline strict<float> sin(strict<float> x) { return static_cast<float>(sin(strict<double>(x.value)).value); }
/// Cosine; as above.
TURBOMAP_HD inline strict<float> cos(strict<float> x) { return static_cast<float>(cos(strict<double>(x.value)).value); }

/// Both at once for any other scalar, through its own sin and cos.
template <class S>
TURBOMAP_HD void sin_cos(const S& x, S& sine, S& cosine) {
  using std::cos;
  using std::sin;
  sine = sin(x);
  cosine = cos(x);
}

TURBOMAP_END_NAMESPACE
