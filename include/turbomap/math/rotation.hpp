// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Rotations as quaternions and matrices: exponential and logarithm, product, normalisation; for double and for dual
/// numbers at a step of zero (no branch divides by an angle of zero).

#include <cmath>

#include "../config.hpp"
#include "../types.hpp"
#include "functions.hpp"
#include "linear.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Whether a pose can be used: finite, its quaternion of unit length within 1e-3 (of its square). Poses of float systems that
/// multiply quaternions without normalising them drift far less than that between two keyframes.
inline bool is_pose(const rigid_transform<double>& T) {
  const double norm = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
  return detail::each_finite(T.qx, T.qy, T.qz, T.qw, T.tx, T.ty, T.tz) && norm - 1 < 1e-3 && norm - 1 > -1e-3;
}

/// 1 / sqrt(x).
template <class S>
TURBOMAP_HD S inverse_root(const S& x) {
  using std::sqrt;
  return S(1) / sqrt(x);
}
/// 1 / sqrt(x), in one operation where a device has it.
TURBOMAP_HD inline double inverse_root(double x) {
#if defined(__CUDA_ARCH__)
  return ::rsqrt(x);
#else
  return 1 / std::sqrt(x);
#endif
}

/// The transform with its quaternion scaled to unit length; as it is where that cannot be.
template <class S>
TURBOMAP_HD rigid_transform<S> normalised(const rigid_transform<S>& T) {
  const S n2 = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
  if (!(n2 > S(0))) return T;
  const S s = inverse_root(n2);
  rigid_transform<S> r = T;
  r.qx = T.qx * s, r.qy = T.qy * s, r.qz = T.qz * s, r.qw = T.qw * s;
  return r;
}

/// sin(t)/t, (1 - cos t)/t^2, (t - sin t)/t^3, sin(t/2)/t and cos(t/2) as functions of t^2: series below 0.01, where
/// the first terms left out are under 1e-17.
template <class S>
struct rotation_coefficients {
  S a;            ///< sin(t) / t
  S b;            ///< (1 - cos t) / t^2
  S c;            ///< (t - sin t) / t^3
  S half_sine;    ///< sin(t / 2) / t
  S half_cosine;  ///< cos(t / 2)

  /// \param t2  square of the angle, rad^2
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

/// Exp: the rotation by |w| radians about w.
template <class S>
TURBOMAP_HD mat3<S> rotation_exp(const vec3<S>& w) {
  const rotation_coefficients<S> k(squared_norm(w));
  const mat3<S> W = skew(w);
  return identity3<S>() + k.a * W + k.b * (W * W);
}

/// Exp(w) and its right Jacobian: Exp(w + d) = Exp(w) Exp(right d) to first order.
template <class S>
struct rotation_jacobian {
  mat3<S> exp;    ///< Exp(w)
  mat3<S> right;  ///< its right Jacobian

  /// \param w  rotation vector, rad
  TURBOMAP_HD explicit rotation_jacobian(const vec3<S>& w) {
    const rotation_coefficients<S> k(squared_norm(w));
    const mat3<S> W = skew(w), WW = W * W;
    exp = identity3<S>() + k.a * W + k.b * WW;
    right = identity3<S>() + (S(0) - k.b) * W + k.c * WW;
  }
};

/// The isometry as quaternion and translation; the quaternion has qw >= 0 or is that of a rotation by more than 120
/// degrees. R must be a rotation.
template <class S>
TURBOMAP_HD rigid_transform<S> to_rigid_transform(const isometry<S>& T) {
  using std::sqrt;
  const auto& R = T.R;
  const S one(1), trace = R(0, 0) + R(1, 1) + R(2, 2);
  S q[4];  // x, y, z, w: the largest of trace and diagonal keeps the root away from 0
  if (trace > R(0, 0) && trace > R(1, 1) && trace > R(2, 2)) {
    const S s = sqrt(one + trace), h = S(0.5) / s;
    q[3] = S(0.5) * s;
    q[0] = (R(2, 1) - R(1, 2)) * h, q[1] = (R(0, 2) - R(2, 0)) * h, q[2] = (R(1, 0) - R(0, 1)) * h;
  } else {
    int i = R(1, 1) > R(0, 0) ? 1 : 0;
    if (R(2, 2) > R(i, i)) i = 2;
    const int j = (i + 1) % 3, k = (j + 1) % 3;
    const S s = sqrt(one + R(i, i) - R(j, j) - R(k, k)), h = S(0.5) / s;
    q[i] = S(0.5) * s;
    q[j] = (R(j, i) + R(i, j)) * h, q[k] = (R(k, i) + R(i, k)) * h, q[3] = (R(k, j) - R(j, k)) * h;
  }
  rigid_transform<S> r;
  r.qx = q[0], r.qy = q[1], r.qz = q[2], r.qw = q[3];
  r.tx = T.t.x, r.ty = T.t.y, r.tz = T.t.z;
  return r;
}

/// Log: the rotation vector of R, the inverse of rotation_exp; its length is in [0, pi].
template <class S>
TURBOMAP_HD vec3<S> rotation_log(const mat3<S>& R) {
  using std::atan2;
  const auto q = to_rigid_transform(isometry<S>{R, {S(0), S(0), S(0)}});
  const vec3<S> v{q.qx, q.qy, q.qz};
  const S n2 = squared_norm(v), w2 = q.qw * q.qw;
  if (n2 < S(1e-4) * w2) {  // 2 atan(x) / (x w) by its series, x = |v| / w
    const S x2 = n2 / w2;
    return (S(2) / q.qw * (S(1) - x2 * (S(1.0 / 3) - x2 * (S(1.0 / 5) - x2 * S(1.0 / 7))))) * v;
  }
  const S n = norm(v);
  const bool turned = q.qw < S(0);  // the same rotation the short way
  const S angle = turned ? S(0) - S(2) * atan2(n, S(0) - q.qw) : S(2) * atan2(n, q.qw);
  return (angle / n) * v;
}

/// Inverse of the right Jacobian of SO(3): Log(Exp(w) Exp(d)) = w + right_jacobian_inverse(w) d to first order.
template <class S>
TURBOMAP_HD mat3<S> right_jacobian_inverse(const vec3<S>& w) {
  const S t2 = squared_norm(w);
  const rotation_coefficients<S> k(t2);
  // (1 - t/2 cot(t/2)) / t^2, by its series where the difference cancels; a / 2b = t/2 cot(t/2)
  const S c = t2 < S(1e-2) ? S(1.0 / 12) + t2 * (S(1.0 / 720) + t2 * (S(1.0 / 30240) + t2 * S(1.0 / 1209600)))
                           : (S(1) - k.a / (k.b + k.b)) / t2;
  const mat3<S> W = skew(w);
  return identity3<S>() + S(0.5) * W + c * (W * W);
}

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
