// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Cholesky factorisation of a symmetric matrix on the host: what local problems end in. Left-looking over the tiles of a
/// tiled_matrix, so that a tile is loaded and stored once. Tiles of zeros are passed over: an order of the unknowns that keeps many of
/// them makes it fast. Several threads take runs of tiles in one order, and wait for those that theirs depend on: a parallel loop
/// per column of tiles would take longer than the column.

#include <sched.h>

#include <cmath>
#include <cstddef>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"
#include "../parallel.hpp"
#include "../plain_vector.hpp"
#include "options.hpp"
#include "tiled_matrix.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The threads of a policy of the host take tiles of a factorisation: `count` calls of worker(i), which may wait for each other's
/// tiles, and finish under one thread too.
template <class Policy, class Worker>
void launch_factorise_tiles(const Policy& policy, int count, const Worker& worker) {
  for_each_index(policy, count, worker);
}

/// Keep one and use it again: it owns the matrix and the progress of a factorisation, so one call at a time.
class dense_cholesky {
 public:
  static constexpr int tile = tiled_matrix::tile;  ///< rows and columns of a tile

  /// The leading dimension, and number of columns, that a matrix of n unknowns is stored with.
  static int padded(int n) { return (n + tile - 1) / tile * tile; }

  /// Factorises A = L L^T.
  /// \param A          the lower triangle, column-major (the upper one, row-major), padded(n) squared; the other triangle and what is
  ///                   beyond n are not read. Tiles of zeros at the beginning of a row are passed over
  /// \param tolerance  a pivot below it times the diagonal element it came from: the matrix is singular
  /// \return false: singular or not positive definite
  bool factorise(const double* A, int n, double tolerance = default_pivot_tolerance) {
    take(A, n);
    return factorise_matrix(tolerance);
  }
  /// The same by the threads of a policy of the host: the same bits.
  template <class Policy>
  bool factorise(const Policy& policy, const double* A, int n, double tolerance = default_pivot_tolerance) {
    take(A, n);
    return factorise_matrix(policy, tolerance);
  }

  /// The matrix, to be filled before it is factorised in place; its factor afterwards.
  tiled_matrix& matrix() { return A_; }
  /// Factorises matrix().
  bool factorise_matrix(double tolerance) {
    prepare(tolerance);
    work();
    return state_.failed == 0;
  }
  /// The same by the threads of a policy of the host: the same bits.
  template <class Policy>
  bool factorise_matrix(const Policy& policy, double tolerance) {
    prepare(tolerance);
    if (A_.tiles() < fewest_shared)
      work();
    else
      launch_factorise_tiles(policy, workers, worker{this});
    return state_.failed == 0;
  }

  /// Solves L L^T x = b in place; x has room for padded(n) numbers.
  TURBOMAP_ONE_BODY void solve(double* x) const {
    const int tiles = A_.tiles();
    for (int i = A_.size(); i < tiles * tile; ++i) x[i] = 0;
    for (int j = 0; j < tiles; ++j) {
      double* const y = x + j * tile;
      const double* l = A_.in(j, j);
      for (int c = 0; c < tile; ++c) {
        const double v = y[c] *= reciprocal(j, c);
        for (int r = c + 1; r < tile; ++r) y[r] -= l[c * tile + r] * v;
      }
      for (int i = j + 1; i < tiles; ++i)
        if (A_.has(i, j)) subtract(A_.in(i, j), y, x + i * tile);
    }
    for (int j = tiles - 1; j >= 0; --j) {
      solve_back<4>(x, j);  // the second half of the tile's columns: the first needs it
      solve_back<0>(x, j);
    }
  }

 private:
  using P = pack<double, 4>;

  double reciprocal(int j, int c) const {
    return reciprocal_[static_cast<std::size_t>(j) * tile + static_cast<std::size_t>(c)];
  }

  /// x -= L y of a tile.
  static void subtract(const double* l, const double* y, double* x) {
    P a = P::load(x), b = P::load(x + 4);
    for (int k = 0; k < tile; ++k) {
      const P v(y[k]);
      a = a - P::load(l + k * tile) * v, b = b - P::load(l + k * tile + 4) * v;
    }
    a.store(x), b.store(x + 4);
  }

  /// Four columns of L^T x = y, from column c of tile j on; all behind them is solved.
  template <int C>
  void solve_back(double* x, int j) const {
    const double* const l = A_.in(j, j);
    double* const y = x + j * tile;
    P sum[4];
    for (int c = 0; c < 4; ++c) sum[c] = P(0.0);
    const auto add = [&sum](const double* rows, const double* of) {
      const P v = P::load(of);
      for (int c = 0; c < 4; ++c) sum[c] = multiply_add(P::load(rows + (C + c) * tile), v, sum[c]);
    };
    if constexpr (C == 0) add(l + 4, y + 4);
    for (int i = j + 1; i < A_.tiles(); ++i)
      if (A_.has(i, j)) add(A_.in(i, j), x + i * tile), add(A_.in(i, j) + 4, x + i * tile + 4);
    for (int c = C + 3; c >= C; --c) {
      double rest = 0, lanes[4];
      for (int r = c + 1; r < C + 4; ++r) rest += l[c * tile + r] * y[r];
      sum[c - C].store(lanes);
      const double v = y[c] - (rest + ((lanes[0] + lanes[2]) + (lanes[1] + lanes[3])));
      y[c] = v * reciprocal(j, c);
    }
  }

  /// Subtracts L(i, 0..j) L(j, 0..j)^T from columns c to c + 3 of tile (i, j).
  void update(int i, int j, int c) {
    P sum[4][2];
    for (auto& s : sum) s[0] = s[1] = P(0.0);
    for (int t = A_.first(i) > A_.first(j) ? A_.first(i) : A_.first(j); t < j; ++t) {
      if (!A_.has(i, t) || !A_.has(j, t)) continue;
      const double *l = A_.in(i, t), *right = A_.in(j, t) + c;
      for (int k = 0; k < tile; ++k, l += tile, right += tile) {
        const P a = P::load(l), b = P::load(l + 4);
        for (int m = 0; m < 4; ++m) {
          const P r(right[m]);
          sum[m][0] = multiply_add(a, r, sum[m][0]);
          sum[m][1] = multiply_add(b, r, sum[m][1]);
        }
      }
    }
    for (int m = 0; m < 4; ++m) {
      double* to = A_.in(i, j) + (c + m) * tile;
      (P::load(to) - sum[m][0]).store(to);
      (P::load(to + 4) - sum[m][1]).store(to + 4);
    }
  }

  bool factorise_tile(int j, double tolerance) {
    update(j, j, 0);
    update(j, j, 4);
    double* const A = A_.in(j, j);
    for (int c = 0; c < tile; ++c) {
      double* l = A + c * tile;
      for (int k = 0; k < c; ++k) {
        const double* left = A + k * tile;
        for (int i = c; i < tile; ++i) l[i] -= left[i] * left[c];
      }
      const double pivot = l[c];
      const std::size_t at = static_cast<std::size_t>(j) * tile + static_cast<std::size_t>(c);
      if (!(pivot > tolerance * diagonal_[at]) || !(pivot > 0) || !detail::is_finite(pivot)) return false;
      const double root = std::sqrt(pivot), r = 1 / root;
      l[c] = root, reciprocal_[at] = r;
      for (int i = c + 1; i < tile; ++i) l[i] *= r;
    }
    return true;
  }

  void solve_tile(int i, int j) {
    update(i, j, 0);
    update(i, j, 4);
    double* const to = A_.in(i, j);
    const double* const pivot = A_.in(j, j);
    P x[tile][2];
    for (int c = 0; c < tile; ++c) {
      x[c][0] = P::load(to + c * tile), x[c][1] = P::load(to + c * tile + 4);
      for (int k = 0; k < c; ++k) {
        const P l(-pivot[k * tile + c]);
        x[c][0] = multiply_add(x[k][0], l, x[c][0]);
        x[c][1] = multiply_add(x[k][1], l, x[c][1]);
      }
      const P r(reciprocal(j, c));
      x[c][0] = x[c][0] * r, x[c][1] = x[c][1] * r;
      x[c][0].store(to + c * tile), x[c][1].store(to + c * tile + 4);
    }
  }

  /// A matrix in full.
  TURBOMAP_ONE_BODY void take(const double* A, int n) {
    A_.reset(n);
    const std::ptrdiff_t stride = padded(n);
    const auto ends_at = [n](int i) { return (i + 1) * tile < n ? (i + 1) * tile : n; };
    const auto first_tile = [&](int i) {  // of a row of tiles that is not zero; the diagonal one at last
      for (int j = 0; j < i * tile; ++j)
        for (int r = i * tile; r < ends_at(i); ++r)
          if (A[j * stride + r] != 0) return j / tile;
      return i;
    };
    for (int i = 0; i < A_.tiles(); ++i)
      for (int j = first_tile(i); j < i; ++j) A_.join(i * tile, j * tile);
    A_.lay_out();
    A_.clear();
    for (int i = 0; i < A_.tiles(); ++i)
      for (int j = A_.first(i) * tile; j < ends_at(i); ++j)
        for (int r = j > i * tile ? j : i * tile; r < ends_at(i); ++r) A_.at(r, j) = A[j * stride + r];
  }
  /// What is to be done before the first tile.
  TURBOMAP_ONE_BODY void prepare(double tolerance) {
    const int tiles = A_.tiles(), n = tiles * tile;
    diagonal_.resize(static_cast<std::size_t>(n)), reciprocal_.resize(static_cast<std::size_t>(n));
    for (int j = 0; j < n; ++j) diagonal_[static_cast<std::size_t>(j)] = A_.at(j, j);
    done_.assign(static_cast<std::size_t>((tiles + group - 1) / group), 0);
    state_ = {tolerance, 0, 0, 0};
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
    double tolerance;
    int next;    ///< task to be taken
    int pivots;  ///< tiles on the diagonal that are factorised
    int failed;  ///< 1: not positive definite
  };

  /// Takes tasks until there are none: column by column of tiles, in each the groups of rows from the diagonal on. A task
  /// waits for the ones before it only, which other threads have taken: so one thread alone never waits.
  TURBOMAP_ONE_BODY void work() {
    const int tiles = A_.tiles(), groups = (tiles + group - 1) / group;
    int column = 0, first = 0;  // first task of the column
    while (column < tiles) {
      const int task = __atomic_fetch_add(&state_.next, 1, __ATOMIC_RELAXED);
      while (column < tiles && task - first >= groups - column / group) first += groups - column++ / group;
      if (column < tiles && !compute(column, column / group + task - first)) return;
    }
  }
  /// Tiles of a column in a group of rows. False: it failed, here or elsewhere.
  bool compute(int column, int rows) {
    const int tiles = A_.tiles(), end = (rows + 1) * group < tiles ? (rows + 1) * group : tiles;
    int i = rows * group;
    int* done = &done_[static_cast<std::size_t>(rows)];
    if (!wait_until(done, column)) return false;
    if (i <= column) {
      if (!factorise_tile(column, state_.tolerance)) {
        __atomic_store_n(&state_.failed, 1, __ATOMIC_RELEASE);
        return false;
      }
      __atomic_store_n(&state_.pivots, column + 1, __ATOMIC_RELEASE);
      i = column + 1;
    } else if (!wait_until(&state_.pivots, column + 1)) {
      return false;
    }
    for (; i < end; ++i)
      if (A_.has(i, column)) solve_tile(i, column);
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

  tiled_matrix A_;
  progress state_{};
  plain_vector<int> done_;  // per group of rows of tiles: its columns that are done
  plain_vector<double> diagonal_, reciprocal_;
};

TURBOMAP_END_NAMESPACE
