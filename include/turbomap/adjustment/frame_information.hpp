// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What all observations together tell about the frames, on the host: for covariances. Landmarks are eliminated by an
/// orthogonal transformation of the derivatives themselves (QR), and products are summed in extended precision, so that what
/// nothing determines stays apart from what is determined weakly: the Schur complement would square the condition first.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../plain_vector.hpp"
#include "block_finder.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Derivatives of single residuals, whitened. \tparam D  unknowns of a frame
template <int D>
struct residual_rows {
  plain_vector<std::int32_t> landmark;  ///< -1: none, or a fixed one
  plain_vector<std::int32_t> first;     ///< free frame; -1: none
  plain_vector<std::int32_t> second;    ///< another free frame; -1: none
  plain_vector<double> d_landmark;      ///< 3 each
  plain_vector<double> d_first;         ///< D each
  plain_vector<double> d_second;        ///< D each
  plain_vector<std::int32_t> spoilt;    ///< free frames with a residual that is not finite

  /// No rows; the memory stays.
  void clear() {
    for (auto* list : {&landmark, &first, &second, &spoilt}) list->clear();
    for (auto* list : {&d_landmark, &d_first, &d_second}) list->clear();
  }
  /// Of a factor of `size` residuals and weight w. \param V  columns of the frames' derivatives
  void add(int l, int a, int b, int size, double w, int V, const double* by_landmark, const double* by_a,
           const double* by_b) {
    if (l < 0 && a < 0 && b < 0) return;
    const double root = std::sqrt(w);
    bool finite = detail::is_finite(root);
    for (int i = 0; i < size * V; ++i)
      finite = finite && (a < 0 || detail::is_finite(by_a[i])) && (b < 0 || detail::is_finite(by_b[i]));
    for (int i = 0; i < 3 * size && l >= 0; ++i) finite = finite && detail::is_finite(by_landmark[i]);
    if (!finite) return spoil(a, b);
    for (int k = 0; k < size; ++k) {
      landmark.push_back(l), first.push_back(a), second.push_back(b);
      for (int i = 0; i < 3; ++i) d_landmark.push_back(l < 0 ? 0 : root * by_landmark[3 * k + i]);
      for (int i = 0; i < D; ++i) {
        d_first.push_back(a >= 0 && i < V ? root * by_a[k * V + i] : 0);
        d_second.push_back(b >= 0 && i < V ? root * by_b[k * V + i] : 0);
      }
    }
  }
  /// Notes that a residual of two frames is not finite; -1: none.
  void spoil(int a, int b) {
    if (a >= 0) spoilt.push_back(a);
    if (b >= 0) spoilt.push_back(b);
  }
};

/// The information of the free frames and its Cholesky factor, row by row from the first element that is not 0.
template <int D>
class frame_information {
 public:
  /// \param held  [free frame] masks of unknowns that are known; empty: none
  TURBOMAP_ONE_BODY void build(const residual_rows<D>& rows, int frames, int landmarks,
                               const plain_vector<std::uint32_t>& held) {
    n_ = frames * D;
    rows_ = &rows, held_ = &held;
    list_by_landmark_(rows.landmark, landmarks, begin_, list_);
    make_room(frames, landmarks);
    for (std::int32_t l = 0; l < landmarks; ++l) add_landmark(begin_[at(l)], begin_[at(l) + 1]);
    for (std::size_t r = 0; r < rows.landmark.size(); ++r)
      if (rows.landmark[r] < 0) add_alone(static_cast<std::int32_t>(r));
  }

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

 private:
  using wide = long double;
  static constexpr double rounding = std::numeric_limits<wide>::epsilon();
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static int larger_of(int a, int b) { return a > b ? a : b; }

  wide* row(int i) { return values_.data() + offset_[at(i)]; }
  const wide* row(int i) const { return values_.data() + offset_[at(i)]; }

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

  /// Which columns each row reaches back to.
  void make_room(int frames, int landmarks) {
    reach_.resize(at(frames));
    for (int f = 0; f < frames; ++f) reach_[at(f)] = f;
    const auto reach = [this](int f, int g) {
      if (f >= 0 && g >= 0 && g < reach_[at(f)]) reach_[at(f)] = g;
    };
    for (std::size_t r = 0; r < rows_->first.size(); ++r)
      reach(rows_->first[r], rows_->second[r]), reach(rows_->second[r], rows_->first[r]);
    for (std::int32_t l = 0; l < landmarks; ++l) {
      int least = frames;
      for (std::int32_t k = begin_[at(l)]; k < begin_[at(l) + 1]; ++k) {
        const int f = rows_->first[at(list_[at(k)])];
        least = f >= 0 && f < least ? f : least;
      }
      for (std::int32_t k = begin_[at(l)]; k < begin_[at(l) + 1]; ++k) reach(rows_->first[at(list_[at(k)])], least);
    }
    first_.resize(at(n_)), offset_.resize(at(n_));
    std::ptrdiff_t size = 0;
    for (int i = 0; i < n_; ++i) {
      first_[at(i)] = reach_[at(i / D)] * D;
      offset_[at(i)] = size - first_[at(i)];
      size += i + 1 - first_[at(i)];
    }
    values_.assign(static_cast<std::size_t>(size), 0);
    for (int i = 0; i < n_; ++i)
      if (is_held(i)) row(i)[i] = 1;
  }
  bool is_held(int i) const { return !held_->empty() && ((*held_)[at(i / D)] >> (i % D) & 1U) != 0; }

  /// Adds the square of one row over some unknowns.
  void add_square(const double* d, const plain_vector<std::int32_t>& frames) {
    const int m = static_cast<int>(frames.size()) * D;
    for (int i = 0; i < m; ++i) {
      if (d[i] == 0) continue;
      const int r = frames[at(i / D)] * D + i % D;
      if (is_held(r)) continue;
      wide* to = row(r);
      for (int j = 0; j < m; ++j) {
        const int c = frames[at(j / D)] * D + j % D;
        if (c <= r && !is_held(c)) to[c] += static_cast<wide>(d[i]) * static_cast<wide>(d[j]);
      }
    }
  }
  void add_alone(std::int32_t r) {
    local_.clear(), line_.clear();
    for (const bool second : {false, true}) {
      const int f = second ? rows_->second[at(r)] : rows_->first[at(r)];
      if (f < 0) continue;
      local_.push_back(f);
      const double* d = (second ? rows_->d_second : rows_->d_first).data() + at(r) * D;
      for (int i = 0; i < D; ++i) line_.push_back(d[i]);
    }
    add_square(line_.data(), local_);
  }

  /// Rows of one landmark: three reflections take its columns to a triangle; the rows below know frames alone.
  void add_landmark(std::int32_t begin, std::int32_t end) {
    const int m = end - begin;
    local_.clear();
    for (std::int32_t k = begin; k < end; ++k) {
      const std::int32_t f = rows_->first[at(list_[at(k)])];
      bool known = f < 0;
      for (const auto g : local_) known = known || g == f;
      if (!known) local_.push_back(f);
    }
    if (local_.empty()) return;
    const int columns = 3 + static_cast<int>(local_.size()) * D;
    line_.assign(at(m) * at(columns), 0);  // row-major
    for (int i = 0; i < m; ++i) {
      const std::size_t r = at(list_[at(begin + i)]);
      double* to = line_.data() + at(i) * at(columns);
      for (int k = 0; k < 3; ++k) to[k] = rows_->d_landmark[3 * r + at(k)];
      for (std::size_t f = 0; f < local_.size(); ++f)
        if (local_[f] == rows_->first[r])
          for (std::size_t k = 0; k < D; ++k) to[3 + f * D + k] = rows_->d_first[r * D + k];
    }
    const int rank = triangulate(m, columns);
    for (int i = rank; i < m; ++i) add_square(line_.data() + at(i) * at(columns) + 3, local_);
  }

  /// Householder reflections with exchange of columns. Returns the rank of the first three columns.
  int triangulate(int m, int columns) {
    constexpr double rounding = 1e-14;  // of the largest column: what is left of a dependent one
    double largest = 0;
    for (int k = 0; k < 3 && k < m; ++k) {
      int best = k;
      double longest = -1;
      for (int c = k; c < 3; ++c) {
        double square = 0;
        for (int i = k; i < m; ++i) square += entry(i, c, columns) * entry(i, c, columns);
        if (square > longest) longest = square, best = c;
      }
      const double length = std::sqrt(longest);
      if (k == 0) largest = length;
      if (!(length > rounding * largest)) return k;
      for (int i = 0; i < m && best != k; ++i) std::swap(entry(i, k, columns), entry(i, best, columns));
      const double head = entry(k, k, columns) > 0 ? -length : length;
      const double pivot = entry(k, k, columns) - head;
      reflection_.assign(at(m), 0);
      for (int i = k; i < m; ++i) reflection_[at(i)] = i == k ? pivot : entry(i, k, columns);
      const double norm = -head * pivot;  // half of the reflection's squared length
      for (int c = k; c < columns; ++c) {
        double sum = 0;
        for (int i = k; i < m; ++i) sum += reflection_[at(i)] * entry(i, c, columns);
        sum /= norm;
        for (int i = k; i < m; ++i) entry(i, c, columns) -= sum * reflection_[at(i)];
      }
    }
    return m < 3 ? m : 3;
  }
  double& entry(int i, int c, int columns) { return line_[at(i) * at(columns) + at(c)]; }

  int n_ = 0;
  const residual_rows<D>* rows_ = nullptr;
  const plain_vector<std::uint32_t>* held_ = nullptr;
  bin_lister list_by_landmark_;
  plain_vector<std::int32_t> begin_, list_, local_, reach_, first_;
  plain_vector<std::ptrdiff_t> offset_;
  plain_vector<std::uint8_t> out_;
  plain_vector<double> line_, reflection_, scale_;
  plain_vector<long double> values_, null_;
};

TURBOMAP_END_NAMESPACE
