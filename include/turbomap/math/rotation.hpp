// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Rotations as quaternions: exponential of a step, product, normalisation; for double and for dual numbers at a step
/// of zero (no branch divides by an angle of zero).

#include <cmath>

#include "../config.hpp"
#include "../types.hpp"
#include "functions.hpp"
#include "linear.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The transform with its quaternion scaled to unit length; as it is where that cannot be.
template <class S>
TURBOMAP_HD rigid_transform<S> normalised(const rigid_transform<S>& T) {
  using std::sqrt;
  const S n2 = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
  if (!(n2 > S(0))) return T;
  const S s = S(1) / sqrt(n2);
  rigid_transform<S> r = T;
  r.qx = T.qx * s, r.qy = T.qy * s, r.qz = T.qz * s, r.qw = T.qw * s;
  return r;
}

/// sin(t)/t, (1 - cos t)/t^2, (t - sin t)/t^3, sin(t/2)/t and cos(t/2) as functions of t^2: series below 0.01, where
/// the first terms left out are under 1e-17.
template <class S>
struct rotation_coefficients {
  S a, b, c, half_sine, half_cosine;

  TURBOMAP_HD explicit rotation_coefficients(const S& t2) {
    using std::sqrt;
    if (t2 < S(1e-4)) {
      a = S(1) - t2 * (S(1.0 / 6) - t2 * (S(1.0 / 120) - t2 * S(1.0 / 5040)));
      b = S(0.5) - t2 * (S(1.0 / 24) - t2 * (S(1.0 / 720) - t2 * S(1.0 / 40320)));
      c = S(1.0 / 6) - t2 * (S(1.0 / 120) - t2 * (S(1.0 / 5040) - t2 * S(1.0 / 362880)));
      half_sine = S(0.5) - t2 * (S(1.0 / 48) - t2 * (S(1.0 / 3840) - t2 * S(1.0 / 645120)));
      half_cosine = S(1) - t2 * (S(1.0 / 8) - t2 * (S(1.0 / 384) - t2 * S(1.0 / 46080)));
      return;
    }
    const S t = sqrt(t2);
    S sine, cosine;
    sin_cos(t, sine, cosine);
    a = sine / t, b = (S(1) - cosine) / t2, c = (t - sine) / (t2 * t);
    sin_cos(S(0.5) * t, sine, half_cosine);
    half_sine = sine / t;
  }
};

/// exp(omega, v) T: the exponential of the rigid motions, its rotation vector first, applied on the left. The
/// quaternion of the result is of unit length.
/// \param step  omega (rad) x y z, v (m) x y z
template <class S>
TURBOMAP_HD rigid_transform<S> left_exp(const S* step, const rigid_transform<double>& T) {
  const vec3<S> w{step[0], step[1], step[2]}, v{step[3], step[4], step[5]};
  const rotation_coefficients<S> k(squared_norm(w));
  const S x = k.half_sine * w.x, y = k.half_sine * w.y, z = k.half_sine * w.z, r = k.half_cosine;
  const auto q = normalised(T);
  const S qx(q.qx), qy(q.qy), qz(q.qz), qw(q.qw);
  const vec3<S> t{S(T.tx), S(T.ty), S(T.tz)};
  const vec3<S> wt = cross(w, t), wv = cross(w, v), moved = t + k.a * wt + k.b * cross(w, wt);
  const vec3<S> shift = v + k.b * wv + k.c * cross(w, wv);
  rigid_transform<S> result;
  result.qx = r * qx + x * qw + y * qz - z * qy;
  result.qy = r * qy - x * qz + y * qw + z * qx;
  result.qz = r * qz + x * qy - y * qx + z * qw;
  result.qw = r * qw - x * qx - y * qy - z * qz;
  result.tx = moved.x + shift.x, result.ty = moved.y + shift.y, result.tz = moved.z + shift.z;
  return normalised(result);
}

TURBOMAP_END_NAMESPACE
