// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Symmetric 3x3 matrices, for any scalar: covariances of points and of pixels, and their inverses. Sums have one fixed order;
/// nothing but + - * / and sqrt, so that strict numbers give the same bits everywhere.

#include <cmath>

#include "../config.hpp"
#include "../types.hpp"
#include "functions.hpp"
#include "linear.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The lower half of a symmetric 3x3 matrix, or a lower triangular one.
template <class S>
struct symmetric3 {
  /// @{
  /// Element of this row and column.
  S xx{}, yx{}, yy{}, zx{}, zy{}, zz{};
  /// @}
};

/// The covariance of a point, m^2, computed with in S.
template <class S>
TURBOMAP_HD symmetric3<S> to_symmetric(const point_covariance& c) {
  return {S(c.xx), S(c.yx), S(c.yy), S(c.zx), S(c.zy), S(c.zz)};
}

/// A += w d d^T
template <class S>
TURBOMAP_HD void add_outer(symmetric3<S>& A, const S& w, const vec3<S>& d) {
  const S x = w * d.x, y = w * d.y, z = w * d.z;
  A.xx = A.xx + x * d.x;
  A.yx = A.yx + y * d.x, A.yy = A.yy + y * d.y;
  A.zx = A.zx + z * d.x, A.zy = A.zy + z * d.y, A.zz = A.zz + z * d.z;
}
/// Sum.
template <class S>
TURBOMAP_HD symmetric3<S> operator+(const symmetric3<S>& A, const symmetric3<S>& B) {
  return {A.xx + B.xx, A.yx + B.yx, A.yy + B.yy, A.zx + B.zx, A.zy + B.zy, A.zz + B.zz};
}
/// A += a I
template <class S>
TURBOMAP_HD void add_to_diagonal(symmetric3<S>& A, const S& a) {
  A.xx = A.xx + a, A.yy = A.yy + a, A.zz = A.zz + a;
}

/// Matrix times vector.
template <class S>
TURBOMAP_HD vec3<S> operator*(const symmetric3<S>& A, const vec3<S>& x) {
  return {A.xx * x.x + A.yx * x.y + A.zx * x.z, A.yx * x.x + A.yy * x.y + A.zy * x.z,
          A.zx * x.x + A.zy * x.y + A.zz * x.z};
}

/// Lower L with L L^T = A, for an A that is the sum of a positive diagonal and of a part without negative eigenvalues:
/// squares of the diagonal of L are then at least `least`. Where rounding says otherwise, `least` is taken.
template <class S>
TURBOMAP_HD symmetric3<S> cholesky(const symmetric3<S>& A, const S& least) {
  using std::sqrt;
  symmetric3<S> L;
  const S& p = A.xx;
  L.xx = sqrt(p > least ? p : least);
  L.yx = A.yx / L.xx, L.zx = A.zx / L.xx;
  const S q = A.yy - L.yx * L.yx;
  L.yy = sqrt(q > least ? q : least);
  L.zy = (A.zy - L.zx * L.yx) / L.yy;
  const S r = A.zz - L.zx * L.zx - L.zy * L.zy;
  L.zz = sqrt(r > least ? r : least);
  return L;
}
/// L x = b
template <class S>
TURBOMAP_HD vec3<S> solve_lower(const symmetric3<S>& L, const vec3<S>& b) {
  const S x = b.x / L.xx, y = (b.y - L.yx * x) / L.yy;
  return {x, y, (b.z - L.zx * x - L.zy * y) / L.zz};
}
/// L^T x = b
template <class S>
TURBOMAP_HD vec3<S> solve_upper(const symmetric3<S>& L, const vec3<S>& b) {
  const S z = b.z / L.zz, y = (b.y - L.zy * z) / L.yy;
  return {(b.x - L.yx * y - L.zx * z) / L.xx, y, z};
}

/// The inverse of a positive definite A, by its Cholesky factor; `least` as in cholesky().
template <class S>
TURBOMAP_HD symmetric3<S> inverse(const symmetric3<S>& A, const S& least) {
  const symmetric3<S> L = cholesky(A, least);
  const S zero(0), one(1);
  symmetric3<S> B;
  const vec3<S> columns[3] = {solve_lower(L, vec3<S>{one, zero, zero}), solve_lower(L, vec3<S>{zero, one, zero}),
                              solve_lower(L, vec3<S>{zero, zero, one})};
  B.xx = dot(columns[0], columns[0]);
  B.yx = dot(columns[1], columns[0]), B.yy = dot(columns[1], columns[1]);
  B.zx = dot(columns[2], columns[0]), B.zy = dot(columns[2], columns[1]), B.zz = dot(columns[2], columns[2]);
  return B;
}
/// x of A x = b for a positive definite A. Of an A that is singular but for rounding x is of no use, and may be very large.
template <class S>
TURBOMAP_HD vec3<S> solve_positive(const symmetric3<S>& A, const vec3<S>& b) {
  return inverse(A, S(detail::epsilon<S>::value) * (A.xx + A.yy + A.zz)) * b;
}

TURBOMAP_END_NAMESPACE
