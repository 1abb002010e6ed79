// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Radial distortion polynomials d(r) = r (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8), r = radius or angle. Fitted inside
/// the image only, they may fold back outside of it: there two rays share a pixel and the model means nothing.

#include <cmath>

#include "../config.hpp"
#include "../math/functions.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class S>
struct radial_polynomial {
  S k1, k2, k3, k4;

  /// d(r) / r, with z = r^2.
  TURBOMAP_HD S factor(const S& z) const {
    const S zz = z * z;  // two short chains instead of a long one: unprojection waits for little else
    return (S(1) + z * k1) + zz * ((k2 + z * k3) + zz * k4);
  }

  /// d'(r), with z = r^2.
  TURBOMAP_HD S slope(const S& z) const {
    const S zz = z * z;
    return (S(1) + z * (S(3) * k1)) + zz * ((S(5) * k2 + z * (S(7) * k3)) + zz * (S(9) * k4));
  }

  static constexpr int samples = 32;  ///< a fold and unfold within 1/32 of r^2 goes unnoticed; no lens does that

  /// A radius^2 in (0, z] where d does not rise, the first of the samples; 0 when it rises all the way.
  TURBOMAP_HD S first_fold(const S& z) const {
    // Without its positive terms the slope only falls, so its value at z bounds it everywhere before: usually enough.
    const S zero(0);
    const S bound = S(1) + z * ((k1 < zero ? S(3) * k1 : zero) +
                                z * ((k2 < zero ? S(5) * k2 : zero) +
                                     z * ((k3 < zero ? S(7) * k3 : zero) + z * (k4 < zero ? S(9) * k4 : zero))));
    if (bound > zero) return zero;
#if defined(__CUDA_ARCH__)
#pragma unroll 1  // seldom run, and part of every projection: unrolled, it was two thirds of the code of fisheye kernels
#endif
    for (int i = 1; i <= samples; ++i) {
      const S t = z * (S(i) * S(1.0 / samples));
      if (!(slope(t) > zero)) return t;
    }
    return zero;
  }

  /// About the solution r of d(r) = y: the first five terms of the inverse series. Any number for a distortion too
  /// strong for them.
  TURBOMAP_HD S guess(const S& y) const {
    const S a3 = -k1, k11 = k1 * k1, a5 = S(3) * k11 - k2, a7 = k1 * (S(8) * k2 - S(12) * k11) - k3;
    const S a9 = k11 * (S(55) * (k11 - k2)) + S(5) * (k2 * k2) + S(10) * (k1 * k3) - k4;
    const S w = y * y, ww = w * w;
    return y + y * (w * ((a3 + w * a5) + ww * (a7 + w * a9)));
  }
  /// After two steps of Newton's method, without a branch.
  TURBOMAP_HD S improved(S r, const S& y) const {
    for (int i = 0; i < 2; ++i) {
      const S z = r * r;
      r = r - (r * factor(z) - y) / slope(z);
    }
    return r;
  }
  /// Whether r is the least solution of d(r) = y to `tolerance` relative, and in (0, end].
  TURBOMAP_HD bool solved(const S& r, const S& y, const S& end, const S& tolerance) const {
    if (!is_finite(r) || !(r > S(0) && r <= end)) return false;
    const S z = r * r, error = r * factor(z) - y;
    return error <= tolerance * y && -error <= tolerance * y && !(first_fold(z) > S(0));
  }

  /// Solves d(r) = y for the least r in [0, end], y >= 0, by Newton's method kept inside a bracket that shrinks, and by
  /// bisection where its steps do not shrink. What comes out is to be checked by the caller: the end of the bracket when
  /// there is no solution.
  TURBOMAP_HD S solve(const S& y, const S& end) const {
    const S tolerance(2 * epsilon<S>::value);
    // By then Newton's method is there, or within a thousandth for rounding; else it goes to and fro inside of the bracket.
    constexpr int usual = 10;
    S low(0), high = end, r = y < end ? y : end, last = end;
    for (int i = 0; i < 60; ++i) {  // bisection alone would need 53
      const S z = r * r, rise = slope(z), error = r * factor(z) - y;
      const bool rising = rise > S(0);
      if (error > S(0) || !rising)
        high = r;
      else
        low = r;
      S next = rising ? r - error / rise : low;
      const S half = S(0.5) * last, near = S(1e-3) * r, longest = half > near ? half : near;
      const bool to_and_fro = i >= usual && (next - r > longest || r - next > longest);
      if (!rising || to_and_fro || !(next >= low && next <= high)) next = S(0.5) * (low + high);
      const S step = next - r;
      r = next;
      if (step <= tolerance * r && -step <= tolerance * r) break;
      last = step < S(0) ? -step : step;
    }
    return r;
  }
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
