// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cholesky factorisation of a full symmetric matrix on the host: what local problems end in. Left-looking over tiles of 8
/// by 8, so that a tile is loaded and stored once. Tiles of zeros at the beginning of a row stay zero and are passed over: an
/// order of the unknowns that makes them long makes it fast (a skyline).

#include <cmath>
#include <cstddef>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "../plain_vector.hpp"
#include "options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Keep one and use it again: it owns the pivots only.
class dense_cholesky {
 public:
  static constexpr int tile = 8;  ///< rows and columns of a tile

  /// The leading dimension, and number of columns, that a matrix of n unknowns is stored with.
  static int padded(int n) { return (n + tile - 1) / tile * tile; }

  /// Replaces the lower triangle of A (column-major: the upper one, row-major) by L with A = L L^T.
  /// \param A          padded(n) squared; the other triangle and what is beyond n are not read, but may be overwritten
  /// \param tolerance  a pivot below it times the diagonal element it came from: the matrix is singular
  /// \return false: singular or not positive definite; A is then spoilt
  TURBOMAP_ONE_BODY bool factorise(double* A, int n, double tolerance = default_pivot_tolerance) {
    n_ = padded(n);
    diagonal_.resize(static_cast<std::size_t>(n_)), reciprocal_.resize(static_cast<std::size_t>(n_));
    for (int j = n; j < n_; ++j) {  // an identity: its steps are 0
      for (int i = 0; i < n_; ++i) column(A, j)[i] = i == j ? 1 : 0;
      for (int i = 0; i < n; ++i) column(A, i)[j] = 0;
    }
    // What lies above the diagonal in its tiles: they are computed as a whole, and nobody wrote this.
    for (int j = 0; j < n; ++j)
      for (int i = j / tile * tile; i < j; ++i) column(A, j)[i] = 0;
    for (int j = 0; j < n_; ++j) diagonal_[static_cast<std::size_t>(j)] = column(A, j)[j];
    begin_.resize(static_cast<std::size_t>(n_ / tile));
    for (int i = 0; i < n_; i += tile) begin_[static_cast<std::size_t>(i / tile)] = first_tile(A, i);
    for (int j = 0; j < n_; j += tile) {
      if (!factorise_tile(A, j, tolerance)) return false;
      for (int i = j + tile; i < n_; i += tile)
        if (begin(i) <= j) solve_tile(A, i, j);
    }
    return true;
  }

  /// Solves L L^T x = b in place; x has room for padded(n) numbers.
  TURBOMAP_ONE_BODY void solve(const double* L, int n, double* x) const {
    for (int i = n; i < n_; ++i) x[i] = 0;
    for (int j = 0; j < n_; ++j) {
      const double* l = column(L, j);
      const double v = x[j] *= reciprocal_[static_cast<std::size_t>(j)];
      for (int i = j + 1; i < n_; ++i) x[i] -= l[i] * v;
    }
    for (int j = n_ - 1; j >= 0; --j) {
      const double* l = column(L, j);
      pack<double, 4> sum(0.0);
      const int aligned = (j + 4) / 4 * 4;
      double rest = 0;
      for (int i = j + 1; i < aligned; ++i) rest += l[i] * x[i];
      for (int i = aligned; i < n_; i += 4)
        sum = multiply_add(pack<double, 4>::load(l + i), pack<double, 4>::load(x + i), sum);
      double lanes[4];
      sum.store(lanes);
      const double v = x[j] - (rest + ((lanes[0] + lanes[2]) + (lanes[1] + lanes[3])));
      x[j] = v * reciprocal_[static_cast<std::size_t>(j)];
    }
  }

 private:
  using P = pack<double, 4>;

  double* column(double* A, int j) const { return A + static_cast<std::ptrdiff_t>(j) * n_; }
  const double* column(const double* A, int j) const { return A + static_cast<std::ptrdiff_t>(j) * n_; }

  /// The first column of the rows i to i + 7 whose tile is not zero; the diagonal one at last.
  int first_tile(const double* A, int i) const {
    for (int j = 0; j < i; ++j)
      for (int r = i; r < i + tile; ++r)
        if (column(A, j)[r] != 0) return j / tile * tile;
    return i;
  }
  int begin(int i) const { return begin_[static_cast<std::size_t>(i / tile)]; }

  /// Subtracts L(rows i.., 0..j) L(rows c.., 0..j)^T from rows i.. of columns c to c + 3.
  void update(double* A, int i, int c, int j) const {
    P sum[4][2];
    for (auto& s : sum) s[0] = s[1] = P(0.0);
    for (int k = begin(i) > begin(c) ? begin(i) : begin(c); k < j; ++k) {
      const double* l = column(A, k);
      const P a = P::load(l + i), b = P::load(l + i + 4);
      for (int m = 0; m < 4; ++m) {
        const P right(l[c + m]);
        sum[m][0] = multiply_add(a, right, sum[m][0]);
        sum[m][1] = multiply_add(b, right, sum[m][1]);
      }
    }
    for (int m = 0; m < 4; ++m) {
      double* to = column(A, c + m) + i;
      (P::load(to) - sum[m][0]).store(to);
      (P::load(to + 4) - sum[m][1]).store(to + 4);
    }
  }

  bool factorise_tile(double* A, int j, double tolerance) {
    update(A, j, j, j);
    update(A, j, j + 4, j);
    for (int c = j; c < j + tile; ++c) {
      double* l = column(A, c);
      for (int k = j; k < c; ++k) {
        const double* left = column(A, k);
        for (int i = c; i < j + tile; ++i) l[i] -= left[i] * left[c];
      }
      const double pivot = l[c];
      if (!(pivot > tolerance * diagonal_[static_cast<std::size_t>(c)]) || !(pivot > 0) || !detail::is_finite(pivot))
        return false;
      const double root = std::sqrt(pivot), r = 1 / root;
      l[c] = root, reciprocal_[static_cast<std::size_t>(c)] = r;
      for (int i = c + 1; i < j + tile; ++i) l[i] *= r;
    }
    return true;
  }

  void solve_tile(double* A, int i, int j) const {
    update(A, i, j, j);
    update(A, i, j + 4, j);
    P x[tile][2];
    for (int c = 0; c < tile; ++c) {
      double* to = column(A, j + c) + i;
      x[c][0] = P::load(to), x[c][1] = P::load(to + 4);
      for (int k = 0; k < c; ++k) {
        const P l(-column(A, j + k)[j + c]);
        x[c][0] = multiply_add(x[k][0], l, x[c][0]);
        x[c][1] = multiply_add(x[k][1], l, x[c][1]);
      }
      const P r(reciprocal_[static_cast<std::size_t>(j) + static_cast<std::size_t>(c)]);
      x[c][0] = x[c][0] * r, x[c][1] = x[c][1] * r;
      x[c][0].store(to), x[c][1].store(to + 4);
    }
  }

  int n_ = 0;
  plain_vector<double> diagonal_, reciprocal_;
  plain_vector<int> begin_;  // per tile of rows: its first column that is not zero
};

TURBOMAP_END_NAMESPACE
