// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Functions of packs that processors have no instruction for.

#include "pack.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The angle of (z, r) from the z axis, in [0, pi], for r >= 0: atan2(r, z). Within 3 units in the last place. NaN
/// where both are 0.
template <class T, int N>
TURBOMAP_HD pack<T, N> polar_angle(const pack<T, N>& r, const pack<T, N>& z) {
  using P = pack<T, N>;
  const P zero(T(0)), one(T(1)), along = larger(z, -z);
  // t = tan of the angle to the nearer axis, in [0, 1]; beyond tan(pi/8), of what it is more than pi/4.
  const P low = select_greater(r, along, along, r), high = select_greater(r, along, r, along);
  const P limit(T(0.41421356237309504880)), steep = select_greater(low, limit * high, one, zero);
  const P half(T(0.5));
  const P t = select_greater(steep, half, low - high, low) / select_greater(steep, half, low + high, high), q = t * t;
  // Rational approximation of atan on |t| <= 0.66 [Moshier, Cephes].
  P a = P(T(-8.750608600031904122785e-1)), b = q + P(T(2.485846490142306297962e1));
  a = multiply_add(a, q, P(T(-1.615753718733365076637e1))), b = multiply_add(b, q, P(T(1.650270098316988542046e2)));
  a = multiply_add(a, q, P(T(-7.500855792314704667340e1))), b = multiply_add(b, q, P(T(4.328810604912902668951e2)));
  a = multiply_add(a, q, P(T(-1.228866684490136173410e2))), b = multiply_add(b, q, P(T(4.853903996359136964868e2)));
  a = multiply_add(a, q, P(T(-6.485021904942025371773e1))), b = multiply_add(b, q, P(T(1.945506571482613964425e2)));
  const P angle = multiply_add(t, q * a / b, t) + select_greater(steep, half, P(T(0.78539816339744830962)), zero);
  const P from_axis = select_greater(r, along, P(T(1.57079632679489661923)) - angle, angle);
  return select_greater(zero, z, P(T(3.14159265358979323846)) - from_axis, from_axis);
}

TURBOMAP_END_NAMESPACE
