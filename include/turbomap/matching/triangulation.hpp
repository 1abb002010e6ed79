// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Linear triangulation of a point from two rays (the null vector of a 4x4 system, Hartley & Zisserman 12.2), without a
/// matrix library: the same operations in the same order on host and device.

#include <cmath>

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A symmetric 4x4 matrix: its upper triangle, row by row.
template <class S>
struct symmetric4 {
  S m00, m01, m02, m03, m11, m12, m13, m22, m23, m33;
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
template <class S>
TURBOMAP_HD void least_eigenvector(const symmetric4<S>& M, S v[4]) {
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
}

/// Adds the two rows that a ray of direction `b` (camera frame) seen by a camera with pose T (frame of the result to camera)
/// contributes: x P2 - z P0 and y P2 - z P1, scaled so that z = 1 where the ray points forward.
template <class S>
TURBOMAP_HD void add_ray(symmetric4<S>& M, const isometry<S>& T, const vec3<S>& b) {
  const bool forward = b.z > S(0);
  const S x = forward ? b.x / b.z : b.x, y = forward ? b.y / b.z : b.y, z = forward ? S(1) : b.z;
  const auto& R = T.R.m;
  add_outer(M, x * R[6] - z * R[0], x * R[7] - z * R[1], x * R[8] - z * R[2], x * T.t.z - z * T.t.x);
  add_outer(M, y * R[6] - z * R[3], y * R[7] - z * R[4], y * R[8] - z * R[5], y * T.t.z - z * T.t.y);
}

/// The point that two rays see, by the linear method, in the frame that both poses map from.
/// \return false when the point is at infinity (fourth coordinate 0)
template <class S>
TURBOMAP_HD bool triangulate(const isometry<S>& T_a, const vec3<S>& ray_a, const isometry<S>& T_b, const vec3<S>& ray_b,
                             vec3<S>& point) {
  symmetric4<S> M{S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0), S(0)};
  add_ray(M, T_a, ray_a);
  add_ray(M, T_b, ray_b);
  S h[4];
  least_eigenvector(M, h);
  if (!(h[3] < S(0)) && !(h[3] > S(0))) return false;
  point = {h[0] / h[3], h[1] / h[3], h[2] / h[3]};
  return true;
}

TURBOMAP_END_NAMESPACE
