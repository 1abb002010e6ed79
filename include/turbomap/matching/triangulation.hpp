// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Triangulation: the point in space that two rays of known cameras come closest to. Each ray gives two linear equations in
/// the homogeneous point, and the null vector of the 4x4 system is the answer (Hartley & Zisserman 12.2). Without a matrix
/// library: the same operations in the same order on host and device.

#include <cmath>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A symmetric 4x4 matrix: its upper triangle, row by row.
template <class S>
struct symmetric4 {
  /// @{
  /// Element of this row and column.
  S m00, m01, m02, m03, m11, m12, m13, m22, m23, m33;
  /// @}
};

/// Adds a^T a for a row a.
template <class S>
TURBOMAP_HD void add_outer(symmetric4<S>& M, S a, S b, S c, S d) {
  M.m00 += a * a, M.m01 += a * b, M.m02 += a * c, M.m03 += a * d;
  M.m11 += b * b, M.m12 += b * c, M.m13 += b * d;
  M.m22 += c * c, M.m23 += c * d, M.m33 += d * d;
}

/// The eigenvector of the least eigenvalue of a positive semidefinite M, not normalised. The eigenvalue is the least root
/// of the characteristic polynomial: Newton's iteration from 0 climbs to it monotonically (all roots are real and not
/// negative). The vector is a column of the adjugate of M - lambda I, which has rank one there.
/// \return whether the vector is good to nine digits; false where the second least eigenvalue nearly vanishes beside the largest
template <class S>
TURBOMAP_HD bool least_eigenvector(const symmetric4<S>& M, S v[4]) {
  // 2x2 minors of rows (0,1) and of rows (2,3), by pairs of columns.
  const S a01 = M.m00 * M.m11 - M.m01 * M.m01, a02 = M.m00 * M.m12 - M.m02 * M.m01, a03 = M.m00 * M.m13 - M.m03 * M.m01;
  const S a12 = M.m01 * M.m12 - M.m02 * M.m11, a13 = M.m01 * M.m13 - M.m03 * M.m11, a23 = M.m02 * M.m13 - M.m03 * M.m12;
  const S b01 = M.m02 * M.m13 - M.m12 * M.m03, b02 = M.m02 * M.m23 - M.m22 * M.m03, b03 = M.m02 * M.m33 - M.m23 * M.m03;
  const S b12 = M.m12 * M.m23 - M.m22 * M.m13, b13 = M.m12 * M.m33 - M.m23 * M.m13, b23 = M.m22 * M.m33 - M.m23 * M.m23;
  const S c0 = a01 * b23 - a02 * b13 + a03 * b12 + a12 * b03 - a13 * b02 + a23 * b01;
  const S d02 = M.m00 * M.m22 - M.m02 * M.m02, d03 = M.m00 * M.m33 - M.m03 * M.m03;
  const S d12 = M.m11 * M.m22 - M.m12 * M.m12, d13 = M.m11 * M.m33 - M.m13 * M.m13;
  const S c2 = a01 + d02 + d03 + d12 + d13 + b23;
  // 3x3 principal minors, each named by the index that is left out.
  const S p3 = M.m22 * a01 - M.m12 * a02 + M.m02 * a12;
  const S p2 = M.m33 * a01 - M.m13 * a03 + M.m03 * a13;
  const S p1 = M.m00 * b23 - M.m02 * b03 + M.m03 * b02;
  const S p0 = M.m11 * b23 - M.m12 * b13 + M.m13 * b12;
  const S c1 = p0 + p1 + p2 + p3;
  const S c3 = M.m00 + M.m11 + M.m22 + M.m33;

  S lambda(0);
  for (int i = 0; i < 16; ++i) {
    const S value = (((lambda - c3) * lambda + c2) * lambda - c1) * lambda + c0;
    const S slope = ((S(4) * lambda - S(3) * c3) * lambda + S(2) * c2) * lambda - c1;
    if (!(slope < S(0))) break;
    const S next = lambda - value / slope;
    if (!(next > lambda)) break;  // converged: rounding ends the climb
    const bool last = next - lambda < S(1e-14) * next;
    lambda = next;
    if (last) break;
  }

  const S n00 = M.m00 - lambda, n11 = M.m11 - lambda, n22 = M.m22 - lambda, n33 = M.m33 - lambda;
  const S e01 = n00 * n11 - M.m01 * M.m01, e02 = n00 * M.m12 - M.m02 * M.m01, e03 = n00 * M.m13 - M.m03 * M.m01;
  const S e12 = M.m01 * M.m12 - M.m02 * n11, e13 = M.m01 * M.m13 - M.m03 * n11;
  const S f03 = M.m02 * n33 - M.m23 * M.m03, f02 = M.m02 * M.m23 - n22 * M.m03;
  const S f12 = M.m12 * M.m23 - n22 * M.m13, f13 = M.m12 * n33 - M.m23 * M.m13, f23 = n22 * n33 - M.m23 * M.m23;
  // Diagonal cofactors: the largest one names the column that is computed with the least cancellation.
  const S q3 = n22 * e01 - M.m12 * e02 + M.m02 * e12;
  const S q2 = n33 * e01 - M.m13 * e03 + M.m03 * e13;
  const S q1 = n00 * f23 - M.m02 * f03 + M.m03 * f02;
  const S q0 = n11 * f23 - M.m12 * f13 + M.m13 * f12;
  // Off-diagonal cofactors C_ij = (-1)^(i+j) minor_ij.
  const S q01 = -(M.m01 * f23 - M.m12 * f03 + M.m13 * f02);
  const S f01 = M.m02 * M.m13 - M.m12 * M.m03;
  const S q02 = M.m01 * f13 - n11 * f03 + M.m13 * f01;
  const S q03 = -(M.m01 * f12 - n11 * f02 + M.m12 * f01);
  const S q12 = -(n00 * f13 - M.m01 * f03 + M.m03 * f01);
  const S q13 = n00 * f12 - M.m01 * f02 + M.m02 * f01;
  const S q23 = -(M.m23 * e01 - M.m13 * e02 + M.m03 * e12);
  using std::abs;
  const S r0 = abs(q0), r1 = abs(q1), r2 = abs(q2), r3 = abs(q3);
  if (r3 >= r0 && r3 >= r1 && r3 >= r2) {
    v[0] = q03, v[1] = q13, v[2] = q23, v[3] = q3;
  } else if (r2 >= r0 && r2 >= r1) {
    v[0] = q02, v[1] = q12, v[2] = q2, v[3] = q23;
  } else if (r1 >= r0) {
    v[0] = q01, v[1] = q1, v[2] = q12, v[3] = q13;
  } else {
    v[0] = q0, v[1] = q01, v[2] = q02, v[3] = q03;
  }
  // About the second least eigenvalue over the largest, which is what rounding is to be compared with.
  return c1 > S(1e-7) * c2 * c3;
}

/// Upper triangle of the QR decomposition of a 4x4 A (row-major), by Householder reflections, in place. False where one of
/// the first three columns depends on those before it.
template <class S>
TURBOMAP_HD bool triangularise(S A[16]) {
  using std::sqrt;
  for (int k = 0; k < 3; ++k) {
    S norm2(0);
    for (int i = k; i < 4; ++i) norm2 += A[4 * i + k] * A[4 * i + k];
    if (!(norm2 > S(0))) return false;
    const S pivot = A[5 * k] > S(0) ? -sqrt(norm2) : sqrt(norm2);
    const S u = A[5 * k] - pivot, scale = S(1) / (pivot * u);
    for (int j = k + 1; j < 4; ++j) {
      S d = u * A[4 * k + j];
      for (int i = k + 1; i < 4; ++i) d += A[4 * i + k] * A[4 * i + j];
      d *= scale;
      A[4 * k + j] += d * u;
      for (int i = k + 1; i < 4; ++i) A[4 * i + j] += d * A[4 * i + k];
    }
    A[5 * k] = pivot;
  }
  return true;
}

/// The least right singular vector of A (row-major, overwritten) by inverse iteration, v <- (A^T A)^-1 v, from an
/// approximation. It works on the triangle of A itself: A^T A squares the condition, and least_eigenvector() has no digit
/// left where a ray is nearly perpendicular to the optical axis. One or two steps where the rays nearly meet.
template <class S>
TURBOMAP_HD void refine_null_vector(S A[16], S v[4]) {
  using std::abs;
  using std::sqrt;
  if (!triangularise(A)) return;
  S largest(0);
  for (int k = 0; k < 4; ++k) largest = abs(A[5 * k]) > largest ? abs(A[5 * k]) : largest;
  const S least = S(detail::epsilon<S>::value) * largest;
  const S p3 = abs(A[15]) > least ? A[15] : least;  // an exact null vector: any tiny pivot finds it
  const S i0 = S(1) / A[0], i1 = S(1) / A[5], i2 = S(1) / A[10], i3 = S(1) / p3;
  constexpr int most_steps = 12;  // more than rays need that could belong together
  for (int step = 0; step < most_steps; ++step) {
    const S y0 = v[0] * i0;
    const S y1 = (v[1] - A[1] * y0) * i1;
    const S y2 = (v[2] - A[2] * y0 - A[6] * y1) * i2;
    const S y3 = (v[3] - A[3] * y0 - A[7] * y1 - A[11] * y2) * i3;
    const S x3 = y3 * i3;
    const S x2 = (y2 - A[11] * x3) * i2;
    const S x1 = (y1 - A[6] * x2 - A[7] * x3) * i1;
    const S x0 = (y0 - A[1] * x1 - A[2] * x2 - A[3] * x3) * i0;
    const S scale = S(1) / sqrt(x0 * x0 + x1 * x1 + x2 * x2 + x3 * x3);
    const S n0 = scale * x0, n1 = scale * x1, n2 = scale * x2, n3 = scale * x3;
    const S d0 = n0 - v[0], d1 = n1 - v[1], d2 = n2 - v[2], d3 = n3 - v[3];
    v[0] = n0, v[1] = n1, v[2] = n2, v[3] = n3;
    if (step > 0 && !(d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3 > S(1e-25))) break;  // also where there is nothing to find
  }
}

/// The two rows that a ray of direction `b` (camera frame) seen by a camera with pose T (frame of the result to camera)
/// contributes: x P2 - z P0 and y P2 - z P1, scaled so that z = 1 where the ray points forward.
template <class S>
TURBOMAP_HD void ray_rows(const isometry<S>& T, const vec3<S>& b, S rows[8]) {
  const bool forward = b.z > S(0);
  const S x = forward ? b.x / b.z : b.x, y = forward ? b.y / b.z : b.y, z = forward ? S(1) : b.z;
  const auto& R = T.R.m;
  rows[0] = x * R[6] - z * R[0], rows[1] = x * R[7] - z * R[1], rows[2] = x * R[8] - z * R[2],
  rows[3] = x * T.t.z - z * T.t.x;
  rows[4] = y * R[6] - z * R[3], rows[5] = y * R[7] - z * R[4], rows[6] = y * R[8] - z * R[5],
  rows[7] = y * T.t.z - z * T.t.y;
}

/// The point that two rays see, by the linear method, in the frame that both poses map from.
/// \param precise  to 1e-9 of the distance; otherwise as good as a test of the point in pixels needs, in half the time
/// \return false when the point is at infinity (fourth coordinate 0)
template <class S>
TURBOMAP_HD bool triangulate(const isometry<S>& T_a, const vec3<S>& ray_a, const isometry<S>& T_b, const vec3<S>& ray_b,
                             vec3<S>& point, bool precise = false) {
  S A[16];
  ray_rows(T_a, ray_a, A);
  ray_rows(T_b, ray_b, A + 8);
  symmetric4<S> M{S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0)};
  for (int i = 0; i < 16; i += 4) add_outer(M, A[i], A[i + 1], A[i + 2], A[i + 3]);
  S h[4];
  if (!least_eigenvector(M, h) || precise) refine_null_vector(A, h);
  if (!(h[3] < S(0)) && !(h[3] > S(0))) return false;
  point = {h[0] / h[3], h[1] / h[3], h[2] / h[3]};
  return true;
}

TURBOMAP_END_NAMESPACE
