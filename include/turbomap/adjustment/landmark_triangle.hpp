// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Eliminates a landmark from the rows of its residuals without squaring them: three reflections take its columns to a triangle; the
/// rows below know frames alone (QR) [Triggs et al. 2000, 9.5].

#include <cmath>
#include <cstddef>
#include <utility>

#include "../config.hpp"
#include "../plain_vector.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Keep one and use it again: it owns the memory that it works in.
class landmark_triangle {
 public:
  /// All elements are 0.
  void reset(int rows, int columns) {
    rows_ = rows, columns_ = columns;
    values_.assign(at(rows) * at(columns), 0);
  }
  /// Row i. Its first three columns are those of the landmark.
  double* row(int i) { return values_.data() + at(i) * at(columns_); }

  /// Householder reflections with exchange of columns. \return the rank of the first three columns: rows from there on are 0 in
  /// them, and what rounding left of the other columns is 0, too
  int triangulate() {
    length_.assign(at(columns_), 0);
    for (int i = 0; i < rows_; ++i)
      for (int c = 3; c < columns_; ++c) length_[at(c)] += entry(i, c) * entry(i, c);
    const int rank = triangulate_landmark();
    for (int i = rank; i < rows_; ++i)
      for (int c = 3; c < columns_; ++c)
        if (std::isfinite(length_[at(c)]) && std::abs(entry(i, c)) <= rounding * std::sqrt(length_[at(c)]))
          entry(i, c) = 0;
    return rank;
  }

 private:
  static constexpr double rounding = 1e-14;  ///< of the largest column, or of its own: what is left of a dependent one

  int triangulate_landmark() {
    const int m = rows_;
    double largest = 0;
    for (int k = 0; k < 3 && k < m; ++k) {
      int best = k;
      double longest = -1;
      for (int c = k; c < 3; ++c) {
        double square = 0;
        for (int i = k; i < m; ++i) square += entry(i, c) * entry(i, c);
        if (square > longest) longest = square, best = c;
      }
      const double length = std::sqrt(longest);
      if (k == 0) largest = length;
      if (!(length > rounding * largest)) return k;
      for (int i = 0; i < m && best != k; ++i) std::swap(entry(i, k), entry(i, best));
      const double head = entry(k, k) > 0 ? -length : length;
      const double pivot = entry(k, k) - head;
      reflection_.assign(at(m), 0);
      for (int i = k; i < m; ++i) reflection_[at(i)] = i == k ? pivot : entry(i, k);
      const double norm = -head * pivot;  // half of the reflection's squared length
      for (int c = k; c < columns_; ++c) {
        double sum = 0;
        for (int i = k; i < m; ++i) sum += reflection_[at(i)] * entry(i, c);
        sum /= norm;
        for (int i = k; i < m; ++i) entry(i, c) -= sum * reflection_[at(i)];
      }
    }
    return m < 3 ? m : 3;
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  double& entry(int i, int c) { return values_[at(i) * at(columns_) + at(c)]; }

  int rows_ = 0, columns_ = 0;
  plain_vector<double> values_, reflection_, length_;
};

TURBOMAP_END_NAMESPACE
