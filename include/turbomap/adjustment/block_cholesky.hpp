// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cholesky factorisation of a sparse symmetric matrix of square blocks on the host, for long trajectories, where few frames
/// share landmarks. Rows are eliminated in an order of least degree, so that few blocks are created that were zero before.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "../config.hpp"
#include "../plain_sort.hpp"
#include "../plain_vector.hpp"
#include "../span.hpp"
#include "options.hpp"
#include "small_cholesky.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// The union of two ascending lists, without two of its elements.
inline void unite(span<const std::int32_t> a, span<const std::int32_t> b, std::int32_t without, std::int32_t nor,
                  plain_vector<std::int32_t>& result) {
  result.clear();
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    const std::int32_t x = j == b.size() || (i < a.size() && a[i] < b[j]) ? a[i] : b[j];
    if (i < a.size() && a[i] == x) ++i;
    if (j < b.size() && b[j] == x) ++j;
    if (x != without && x != nor) result.push_back(x);
  }
}

}  // namespace detail

/// \tparam D  rows of a block
template <int D>
class block_cholesky {
 public:
  static constexpr std::size_t square = static_cast<std::size_t>(D) * D;  ///< numbers of a block

  /// Orders the rows and finds the blocks of the factor. Block k of the matrix couples row[k] < column[k]; all diagonal
  /// blocks are there. O(n^2 + blocks of the factor times their rows).
  void analyse(int n, span<const std::int32_t> row, span<const std::int32_t> column) {
    n_ = n;
    auto& neighbours = neighbours_;
    auto& merged = merged_;
    if (neighbours.size() < at(n)) neighbours.resize(at(n));
    for (auto& list : neighbours) list.clear();
    for (std::size_t k = 0; k < row.size(); ++k) {
      neighbours[at(row[k])].push_back(column[k]);
      neighbours[at(column[k])].push_back(row[k]);
    }
    for (auto& list : neighbours) sort_plain(list.data(), list.size());
    place_.assign(at(n), -1), order_.clear();
    begin_.assign(1, 0), rows_.clear();
    for (int k = 0; k < n; ++k) {  // eliminates the row of least degree: its neighbours become a clique
      int best = -1;
      for (int i = 0; i < n; ++i)
        if (place_[at(i)] < 0 && (best < 0 || neighbours[at(i)].size() < neighbours[at(best)].size())) best = i;
      place_[at(best)] = k, order_.push_back(best);
      auto& clique = neighbours[at(best)];
      rows_.append(clique.data(), clique.size());
      begin_.push_back(rows_.size());
      for (const auto i : clique) {
        auto& mine = neighbours[at(i)];
        detail::unite(mine, clique, i, best, merged);
        mine = merged;
      }
      clique.clear();
    }
    for (auto& r : rows_) r = place_[at(r)];
    for (int k = 0; k < n; ++k) sort_plain(rows_.data() + begin_[at(k)], begin_[at(k) + 1] - begin_[at(k)]);
    source_.assign(row.size(), 0), transposed_.assign(row.size(), 0);
    for (std::size_t b = 0; b < row.size(); ++b) {
      const std::int32_t i = place_[at(row[b])], j = place_[at(column[b])], lower = std::max(i, j), k = std::min(i, j);
      const auto first = rows_.begin() + offset(begin_[at(k)]), last = rows_.begin() + offset(begin_[at(k) + 1]);
      source_[b] = static_cast<std::size_t>(std::lower_bound(first, last, lower) - rows_.begin());
      transposed_[b] = i < j;  // stored below the diagonal: the given block has rows of the smaller one
    }
    position_.assign(at(n), 0);
  }

  /// \param blocks  n diagonal blocks, then the others in the order of analyse(), row-major, rows of row[k]
  /// \param tolerance  a pivot below it times the diagonal element it came from: the matrix is singular
  /// \return false: singular or not positive definite
  TURBOMAP_ONE_BODY bool factorise(const double* blocks, double tolerance = default_pivot_tolerance) {
    diagonal_.resize(at(n_) * square), lower_.assign(rows_.size() * square, 0);
    for (int i = 0; i < n_; ++i)
      std::copy_n(blocks + at(i) * square, square, diagonal_.begin() + offset(at(place_[at(i)]) * square));
    for (std::size_t b = 0; b < source_.size(); ++b) {
      const double* from = blocks + (at(n_) + b) * square;
      double* to = lower_.data() + source_[b] * square;
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c) to[r * D + c] = transposed_[b] ? from[c * D + r] : from[r * D + c];
    }
    original_.resize(at(n_) * D);
    for (int k = 0; k < n_; ++k)
      for (int i = 0; i < D; ++i) original_[at(k) * D + at(i)] = diagonal_[at(k) * square + at(i * (D + 1))];
    for (int k = 0; k < n_; ++k) {
      if (!factorise_small<D>(diagonal_.data() + at(k) * square, original_.data() + at(k) * D, tolerance)) return false;
      eliminate(k);
    }
    return true;
  }

  /// Solves for x in place, in the order of the caller.
  TURBOMAP_ONE_BODY void solve(double* x) {
    solution_.resize(at(n_) * D);
    for (int i = 0; i < n_; ++i) std::copy_n(x + at(i) * D, D, solution_.data() + at(place_[at(i)]) * D);
    for (int k = 0; k < n_; ++k) {
      double* y = solution_.data() + at(k) * D;
      solve_lower<D>(diagonal_.data() + at(k) * square, y);
      for (std::size_t p = begin_[at(k)]; p < begin_[at(k) + 1]; ++p) {
        double* z = solution_.data() + at(rows_[p]) * D;
        const double* m = lower_.data() + p * square;
        for (int i = 0; i < D; ++i)
          for (int j = 0; j < D; ++j) z[i] -= m[i * D + j] * y[j];
      }
    }
    for (int k = n_ - 1; k >= 0; --k) {
      double* y = solution_.data() + at(k) * D;
      for (std::size_t p = begin_[at(k)]; p < begin_[at(k) + 1]; ++p) {
        const double* z = solution_.data() + at(rows_[p]) * D;
        const double* m = lower_.data() + p * square;
        for (int i = 0; i < D; ++i)
          for (int j = 0; j < D; ++j) y[j] -= m[i * D + j] * z[i];
      }
      solve_upper<D>(diagonal_.data() + at(k) * square, y);
    }
    for (int i = 0; i < n_; ++i) std::copy_n(solution_.data() + at(place_[at(i)]) * D, D, x + at(i) * D);
  }

  /// Blocks of the factor below the diagonal.
  std::size_t fill() const { return rows_.size(); }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static std::ptrdiff_t offset(std::size_t i) { return static_cast<std::ptrdiff_t>(i); }

  /// Blocks of column k through the factor of its diagonal, then their products out of the later columns.
  void eliminate(int k) {
    const double* l = diagonal_.data() + at(k) * square;
    for (std::size_t p = begin_[at(k)]; p < begin_[at(k) + 1]; ++p) {
      double* m = lower_.data() + p * square;
      for (int r = 0; r < D; ++r) solve_lower<D>(l, m + r * D);
    }
    for (std::size_t p = begin_[at(k)]; p < begin_[at(k) + 1]; ++p) {
      const std::int32_t j = rows_[p];
      const double* right = lower_.data() + p * square;
      subtract(diagonal_.data() + at(j) * square, right, right);
      for (std::size_t q = begin_[at(j)]; q < begin_[at(j) + 1]; ++q) position_[at(rows_[q])] = q;
      for (std::size_t q = p + 1; q < begin_[at(k) + 1]; ++q)
        subtract(lower_.data() + position_[at(rows_[q])] * square, lower_.data() + q * square, right);
    }
  }

  /// to -= left right^T
  static void subtract(double* to, const double* left, const double* right) {
    for (int r = 0; r < D; ++r)
      for (int c = 0; c < D; ++c) {
        double sum = 0;
        for (int m = 0; m < D; ++m) sum += left[r * D + m] * right[c * D + m];
        to[r * D + c] -= sum;
      }
  }

  int n_ = 0;
  std::vector<plain_vector<std::int32_t>> neighbours_;  ///< of analyse(), kept for its memory
  plain_vector<std::int32_t> merged_;
  plain_vector<std::int32_t> place_, order_, rows_;  ///< place of a row in the order; rows of each column, by place
  plain_vector<std::size_t> begin_, source_, position_;
  plain_vector<char> transposed_;
  plain_vector<double> diagonal_, lower_, original_, solution_;
};

TURBOMAP_END_NAMESPACE
