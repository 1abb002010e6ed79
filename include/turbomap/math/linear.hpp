// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Products of 3-vectors, 3x3 matrices and rigid transforms, for any scalar (float, double, strict<double>, a dual
/// number). Every sum has one fixed order, left to right, so that results do not depend on the compiler or the policy;
/// a matrix library does not promise that.

#include <cmath>

#include "../config.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Converts element by element, e.g. vec3<float> to vec3<strict<double>>.
template <class S, class T>
TURBOMAP_HD vec3<S> cast(const vec3<T>& a) {
  return {S(a.x), S(a.y), S(a.z)};
}
/// Element by element.
template <class S, class T>
TURBOMAP_HD vec2<S> cast(const vec2<T>& a) {
  return {S(a.x), S(a.y)};
}
/// Element by element.
template <class S, class T>
TURBOMAP_HD mat3<S> cast(const mat3<T>& a) {
  mat3<S> r;
  for (int i = 0; i < 9; ++i) r.m[i] = S(a.m[i]);
  return r;
}
/// Element by element.
template <class S, class T>
TURBOMAP_HD rigid_transform<S> cast(const rigid_transform<T>& a) {
  rigid_transform<S> r;
  r.qx = S(a.qx), r.qy = S(a.qy), r.qz = S(a.qz), r.qw = S(a.qw);
  r.tx = S(a.tx), r.ty = S(a.ty), r.tz = S(a.tz);
  return r;
}

/// Sum.
template <class S>
TURBOMAP_HD vec3<S> operator+(const vec3<S>& a, const vec3<S>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
/// Difference.
template <class S>
TURBOMAP_HD vec3<S> operator-(const vec3<S>& a, const vec3<S>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
/// Scaled by s.
template <class S>
TURBOMAP_HD vec3<S> operator*(const S& s, const vec3<S>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
/// Scalar product.
template <class S>
TURBOMAP_HD S dot(const vec3<S>& a, const vec3<S>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
/// Cross product a x b.
template <class S>
TURBOMAP_HD vec3<S> cross(const vec3<S>& a, const vec3<S>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Squared length.
template <class S>
TURBOMAP_HD S squared_norm(const vec3<S>& a) {
  return dot(a, a);
}
/// Length.
template <class S>
TURBOMAP_HD S norm(const vec3<S>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}

/// Matrix times vector.
template <class S>
TURBOMAP_HD vec3<S> operator*(const mat3<S>& A, const vec3<S>& x) {
  return {A.m[0] * x.x + A.m[1] * x.y + A.m[2] * x.z, A.m[3] * x.x + A.m[4] * x.y + A.m[5] * x.z,
          A.m[6] * x.x + A.m[7] * x.y + A.m[8] * x.z};
}
/// Matrix product.
template <class S>
TURBOMAP_HD mat3<S> operator*(const mat3<S>& A, const mat3<S>& B) {
  mat3<S> C;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) C(r, c) = A(r, 0) * B(0, c) + A(r, 1) * B(1, c) + A(r, 2) * B(2, c);
  return C;
}
/// Transposed matrix.
template <class S>
TURBOMAP_HD mat3<S> transpose(const mat3<S>& A) {
  return {{A.m[0], A.m[3], A.m[6], A.m[1], A.m[4], A.m[7], A.m[2], A.m[5], A.m[8]}};
}
/// Sum.
template <class S>
TURBOMAP_HD mat3<S> operator+(const mat3<S>& A, const mat3<S>& B) {
  mat3<S> C;
  for (int i = 0; i < 9; ++i) C.m[i] = A.m[i] + B.m[i];
  return C;
}
/// Scaled by s.
template <class S>
TURBOMAP_HD mat3<S> operator*(const S& s, const mat3<S>& A) {
  mat3<S> C;
  for (int i = 0; i < 9; ++i) C.m[i] = s * A.m[i];
  return C;
}
/// The unit matrix.
template <class S>
TURBOMAP_HD mat3<S> identity3() {
  const S zero(0), one(1);
  return {{one, zero, zero, zero, one, zero, zero, zero, one}};
}
/// The matrix [a]x of the cross product: [a]x b = a x b.
template <class S>
TURBOMAP_HD mat3<S> skew(const vec3<S>& a) {
  const S zero(0);
  return {{zero, S(0) - a.z, a.y, a.z, zero, S(0) - a.x, S(0) - a.y, a.x, zero}};
}

/// The rotation matrix of the quaternion as stored (homogeneous of degree two for a non-unit one).
template <class S>
TURBOMAP_HD mat3<S> rotation(const rigid_transform<S>& T) {
  const S x2 = T.qx + T.qx, y2 = T.qy + T.qy, z2 = T.qz + T.qz;
  const S wx = x2 * T.qw, wy = y2 * T.qw, wz = z2 * T.qw;
  const S xx = x2 * T.qx, xy = y2 * T.qx, xz = z2 * T.qx;
  const S yy = y2 * T.qy, yz = z2 * T.qy, zz = z2 * T.qz;
  const S one(1);
  return {{one - (yy + zz), xy - wz, xz + wy, xy + wz, one - (xx + zz), yz - wx, xz - wy, yz + wx, one - (xx + yy)}};
}
/// The translation of a transform.
template <class S>
TURBOMAP_HD vec3<S> translation(const rigid_transform<S>& T) {
  return {T.tx, T.ty, T.tz};
}

/// A rigid transform as matrix and vector: what geometry computes with.
template <class S>
struct isometry {
  mat3<S> R;  ///< rotation matrix
  vec3<S> t;  ///< translation, m
};
/// Matrix and vector of a transform, computed in S. A quaternion whose length is off by more than numbers of type float round to is
/// scaled to unit length: what is no rotation has another inverse than its transpose, so a camera's centre would be off by as much
/// of its distance from the origin. Others are taken as they are.
template <class S, class T>
TURBOMAP_HD isometry<S> to_isometry(const rigid_transform<T>& T_ab) {
  using std::sqrt;
  auto q = cast<S>(T_ab);
  const S n2 = q.qx * q.qx + q.qy * q.qy + q.qz * q.qz + q.qw * q.qw, off = n2 - S(1), rounding(1e-6);
  if (n2 > S(0) && (off > rounding || off < S(0) - rounding)) {
    const S s = S(1) / sqrt(n2);
    q.qx = q.qx * s, q.qy = q.qy * s, q.qz = q.qz * s, q.qw = q.qw * s;
  }
  return {rotation(q), translation(q)};
}
/// Converts element by element.
template <class S, class T>
TURBOMAP_HD isometry<S> cast(const isometry<T>& a) {
  isometry<S> b;
  for (int i = 0; i < 9; ++i) b.R.m[i] = S(a.R.m[i]);
  b.t = cast<S>(a.t);
  return b;
}
/// The point x moved by T: R x + t.
template <class S>
TURBOMAP_HD vec3<S> operator*(const isometry<S>& T, const vec3<S>& x) {
  return T.R * x + T.t;
}
/// First b, then a.
template <class S>
TURBOMAP_HD isometry<S> operator*(const isometry<S>& a, const isometry<S>& b) {
  return {a.R * b.R, a.R * b.t + a.t};
}
/// The inverse transform, by the transpose of R.
template <class S>
TURBOMAP_HD isometry<S> inverse(const isometry<S>& a) {
  const mat3<S> Rt = transpose(a.R);
  const vec3<S> t = Rt * a.t;
  return {Rt, {-t.x, -t.y, -t.z}};
}

/// The camera centre in world coordinates of a pose `T_cw`.
template <class S>
TURBOMAP_HD vec3<S> camera_centre(const isometry<S>& T_cw) {
  return inverse(T_cw).t;
}

TURBOMAP_END_NAMESPACE
