// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The Cholesky factor of a symmetric matrix that is kept row by row, from the first element that is not 0: the factor has the same
/// shape. In extended precision, so that an unknown that nothing determines is told from one that is determined weakly.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "../config.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Lower triangle of the matrix, then of its factor. Call reset(), fill row(), factorise(), solve().
class profile_cholesky {
 public:
  using wide = long double;  ///< of the elements

  /// All elements are 0. \param first  [row] column of its first element
  void reset(const plain_vector<std::int32_t>& first) {
    n_ = static_cast<int>(first.size());
    first_.assign(first.begin(), first.end());
    offset_.resize(first.size());
    std::ptrdiff_t size = 0;
    for (int i = 0; i < n_; ++i) {
      offset_[at(i)] = size - first_[at(i)];
      size += i + 1 - first_[at(i)];
    }
    values_.assign(static_cast<std::size_t>(size), 0);
  }
  /// Row i, by column: from its first element to the diagonal.
  wide* row(int i) { return values_.data() + offset_[at(i)]; }
  /// The same.
  const wide* row(int i) const { return values_.data() + offset_[at(i)]; }

  /// Factorises. An unknown of which the others leave no more than rounding is taken out; all that moves with it is
  /// undetermined then.
  /// \param tolerance  rounding, relative to what is summed: no less than that of `long double` is taken
  /// \param undetermined  [unknown] 1: the observations do not tell it
  TURBOMAP_ONE_BODY void factorise(double tolerance, plain_vector<std::uint8_t>& undetermined) {
    tolerance = tolerance > rounding ? tolerance : rounding;
    undetermined.assign(at(n_), 0), out_.assign(at(n_), 0);
    scale_.resize(at(n_));
    for (int i = 0; i < n_; ++i) scale_[at(i)] = std::sqrt(static_cast<double>(row(i)[i]));
    for (int i = 0; i < n_; ++i) {
      wide* a = row(i);
      const wide own = a[i];
      for (int j = first_[at(i)]; j < i; ++j) {
        if (out_[at(j)] != 0) {
          a[j] = 0;
          continue;
        }
        const wide* b = row(j);
        wide sum = a[j];
        for (int k = larger_of(first_[at(i)], first_[at(j)]); k < j; ++k) sum -= a[k] * b[k];
        a[j] = sum / b[j];
        a[i] -= a[j] * a[j];
      }
      if (is_told(i, own, tolerance)) {
        a[i] = std::sqrt(a[i]);
      } else {
        out_[at(i)] = 1, a[i] = 1;
        mark(i, undetermined);
      }
    }
  }

  /// Solves for x in place; unknowns that are out get 0.
  TURBOMAP_ONE_BODY void solve(plain_vector<long double>& x) const {
    for (int i = 0; i < n_; ++i) {
      const wide* a = row(i);
      for (int k = first_[at(i)]; k < i; ++k) x[at(i)] -= a[k] * x[at(k)];
      x[at(i)] = out_[at(i)] != 0 ? 0 : x[at(i)] / a[i];
    }
    solve_back(x, n_);
  }

  /// How many unknowns factorise() took out: the dimension of what nothing tells.
  int left_out() const {
    int n = 0;
    for (const auto out : out_) n += out;
    return n;
  }

 private:
  static constexpr double rounding = std::numeric_limits<wide>::epsilon();
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static int larger_of(int a, int b) { return a > b ? a : b; }

  /// x <- L^-T x of the first n unknowns.
  void solve_back(plain_vector<long double>& x, int n) const {
    for (int i = n - 1; i >= 0; --i) {
      const wide* a = row(i);
      x[at(i)] = out_[at(i)] != 0 ? 0 : x[at(i)] / a[i];
      for (int k = first_[at(i)]; k < i; ++k) x[at(k)] -= a[k] * x[at(i)];
    }
  }

  /// Whether more than rounding is left of the pivot of unknown i. Rounding is that of the sum v^T S v, where v is how all
  /// unknowns would move with this one.
  bool is_told(int i, wide own, double tolerance) {
    constexpr double plenty = 1e-8;  // of its own element: not worth looking closer
    const wide pivot = row(i)[i];
    if (!(own > 0) || !(pivot > 0)) return false;
    if (pivot > static_cast<wide>(plenty) * own) return true;
    move_with(i);
    double size = 0;
    for (int k = 0; k <= i; ++k) size += moved(k);
    return static_cast<double>(pivot) > tolerance * size * size;
  }
  /// How the unknowns before unknown i move where it moves by 1 and nothing is felt.
  void move_with(int i) {
    null_.assign(at(n_), 0);
    const wide* a = row(i);
    for (int k = first_[at(i)]; k < i; ++k) null_[at(k)] = -a[k];
    solve_back(null_, i);
    null_[at(i)] = 1;
  }
  double moved(int k) const { return std::abs(static_cast<double>(null_[at(k)])) * scale_[at(k)]; }

  /// The unknowns that move with unknown i, which nothing holds.
  void mark(int i, plain_vector<std::uint8_t>& undetermined) {
    constexpr double part = 1e-5;  // of the largest: below it, an unknown does not take part
    undetermined[at(i)] = 1;
    move_with(i);
    double largest = 0;
    for (int k = 0; k <= i; ++k) largest = moved(k) > largest ? moved(k) : largest;
    for (int k = 0; k < i; ++k)
      if (moved(k) > part * largest) undetermined[at(k)] = 1;
  }

  int n_ = 0;
  plain_vector<std::int32_t> first_;
  plain_vector<std::ptrdiff_t> offset_;
  plain_vector<wide> values_, null_;
  plain_vector<double> scale_;
  plain_vector<std::uint8_t> out_;
};

TURBOMAP_END_NAMESPACE
