// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cholesky factorisation of a small symmetric matrix, A = L L^T, and the solution of L L^T x = b: for one block, on the
/// host or by one thread of a device. Row by row, lower triangle; the upper one is neither read nor written.

#include <cmath>

#include "../config.hpp"
#include "../math/functions.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Replaces the lower triangle of A by L.
/// \param tolerance  a pivot below it times `original`, the diagonal element that it came from: singular
/// \param original   [D]; null: any positive pivot will do
/// \return false: singular or not positive definite; A is then spoilt
template <int D>
TURBOMAP_HD bool factorise_small(double* A, const double* original = nullptr, double tolerance = 0) {
  for (int j = 0; j < D; ++j)
    for (int i = j; i < D; ++i) {
      double s = A[i * D + j];
      for (int m = 0; m < j; ++m) s -= A[i * D + m] * A[j * D + m];
      if (i == j) {
        if (original != nullptr && !(s > tolerance * original[j])) return false;
        if (!(s > 0) || !detail::is_finite(s)) return false;
      }
      A[i * D + j] = i == j ? ::sqrt(s) : s / A[j * D + j];
    }
  return true;
}

/// x <- L^-1 x
template <int D>
TURBOMAP_HD void solve_lower(const double* L, double* x) {
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j < i; ++j) x[i] -= L[i * D + j] * x[j];
    x[i] /= L[i * D + i];
  }
}

/// x <- L^-T x
template <int D>
TURBOMAP_HD void solve_upper(const double* L, double* x) {
  for (int i = D - 1; i >= 0; --i) {
    for (int j = i + 1; j < D; ++j) x[i] -= L[j * D + i] * x[j];
    x[i] /= L[i * D + i];
  }
}

TURBOMAP_END_NAMESPACE
