// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cholesky factorisation of a full symmetric matrix on the host: what local problems end in. Left-looking over tiles of 8
/// by 8, so that a tile is loaded and stored once. Tiles of zeros at the beginning of a row stay zero and are passed over: an
/// order of the unknowns that makes them long makes it fast (a skyline). Several threads take runs of tiles in one order, and
/// wait for those that theirs depend on: a parallel loop per column of tiles would take longer than the column.

#include <sched.h>

#include <cmath>
#include <cstddef>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "../plain_vector.hpp"
#include "options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Keep one and use it again: it owns the pivots and the progress of a factorisation, so one call at a time.
class dense_cholesky {
 public:
  static constexpr int tile = 8;  ///< rows and columns of a tile

  /// The leading dimension, and number of columns, that a matrix of n unknowns is stored with.
  static int padded(int n) { return (n + tile - 1) / tile * tile; }

  /// Replaces the lower triangle of A (column-major: the upper one, row-major) by L with A = L L^T.
  /// \param A          padded(n) squared; the other triangle and what is beyond n are not read, but may be overwritten
  /// \param tolerance  a pivot below it times the diagonal element it came from: the matrix is singular
  /// \return false: singular or not positive definite; A is then spoilt
  bool factorise(double* A, int n, double tolerance = default_pivot_tolerance) {
    prepare(A, n, tolerance);
    work();
    return state_.failed == 0;
  }
  /// The same by the threads of a policy of the host: the same bits.
  template <class Policy>
  bool factorise(const Policy& policy, double* A, int n, double tolerance = default_pivot_tolerance) {
    prepare(A, n, tolerance);
    if (n_ < tile * fewest_shared)
      work();
    else
      for_each_index(policy, workers, worker{this});
    return state_.failed == 0;
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

  /// What is to be done before the first tile.
  TURBOMAP_ONE_BODY void prepare(double* A, int n, double tolerance) {
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
    const int groups = (n_ / tile + group - 1) / group;
    done_.resize(static_cast<std::size_t>(groups));
    for (int& columns : done_) columns = 0;
    state_ = {A, tolerance, 0, 0, 0};
  }

  static constexpr int group = 2;          ///< tiles below each other that one task computes
  static constexpr int workers = 4;        ///< threads that share the tasks: more would wait for each other
  static constexpr int fewest_shared = 8;  ///< tiles of a column: fewer are done sooner than threads begin

  struct worker {
    dense_cholesky* c;
    void operator()(int) const { c->work(); }
  };
  /// Shared by the threads.
  struct progress {
    double* A;
    double tolerance;
    int next;    ///< task to be taken
    int pivots;  ///< tiles on the diagonal that are factorised
    int failed;  ///< 1: not positive definite
  };

  /// Takes tasks until there are none: column by column of tiles, in each the groups of rows from the diagonal on. A task
  /// waits for the ones before it only, which other threads have taken: so one thread alone never waits.
  TURBOMAP_ONE_BODY void work() {
    const int tiles = n_ / tile, groups = (tiles + group - 1) / group;
    int column = 0, first = 0;  // first task of the column
    while (column < tiles) {
      const int task = __atomic_fetch_add(&state_.next, 1, __ATOMIC_RELAXED);
      while (column < tiles && task - first >= groups - column / group) first += groups - column++ / group;
      if (column < tiles && !compute(column, column / group + task - first)) return;
    }
  }
  /// Tiles of a column in a group of rows. False: it failed, here or elsewhere.
  bool compute(int column, int rows) {
    const int tiles = n_ / tile, end = (rows + 1) * group < tiles ? (rows + 1) * group : tiles;
    int i = rows * group;
    int* done = &done_[static_cast<std::size_t>(rows)];
    if (!wait_until(done, column)) return false;
    if (i <= column) {
      if (!factorise_tile(state_.A, column * tile, state_.tolerance)) {
        __atomic_store_n(&state_.failed, 1, __ATOMIC_RELEASE);
        return false;
      }
      __atomic_store_n(&state_.pivots, column + 1, __ATOMIC_RELEASE);
      i = column + 1;
    } else if (!wait_until(&state_.pivots, column + 1)) {
      return false;
    }
    for (; i < end; ++i)
      if (begin(i * tile) <= column * tile) solve_tile(state_.A, i * tile, column * tile);
    __atomic_store_n(done, column + 1, __ATOMIC_RELEASE);
    return true;
  }
  /// Waits for another thread's count. It mostly takes less than a microsecond, so the processor is given away late only.
  bool wait_until(const int* count, int least) const {
    for (int spins = 0; __atomic_load_n(count, __ATOMIC_ACQUIRE) < least; ++spins) {
      if (__atomic_load_n(&state_.failed, __ATOMIC_ACQUIRE) != 0) return false;
      if (spins > 1000) sched_yield();
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
    return true;
  }

  int n_ = 0;
  progress state_{};
  plain_vector<int> done_;  // per group of rows of tiles: its columns that are done
  plain_vector<double> diagonal_, reciprocal_;
  plain_vector<int> begin_;  // per tile of rows: its first column that is not zero
};

TURBOMAP_END_NAMESPACE
