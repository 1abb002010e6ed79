// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Dense and block-sparse Cholesky against Eigen; singular matrices are told.

#include <doctest/doctest.h>

#include <thrust/system/cpp/execution_policy.h>

#include <algorithm>
#include <cfenv>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include <turbomap/adjustment/block_cholesky.hpp>
#include <turbomap/adjustment/dense_cholesky.hpp>
#include <turbomap/adjustment/tiled_matrix.hpp>
#include <turbomap/adjustment/unknown_order.hpp>

#include "reference/eigen.hpp"
TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/Cholesky>
TURBOMAP_TEST_EIGEN_END

#include "support/policies.hpp"

namespace {

using turbomap::block_cholesky;
using turbomap::dense_cholesky;

Eigen::MatrixXd random_matrix(int rows, int columns, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&]() { return normal(random); });
}

/// Positive definite, of a rank.
Eigen::MatrixXd symmetric(int n, int rank, unsigned seed) {
  const Eigen::MatrixXd J = random_matrix(rank, n, seed);
  return J.transpose() * J;
}

std::vector<double> padded_copy(const Eigen::MatrixXd& S) {
  const int n = static_cast<int>(S.rows()), m = dense_cholesky::padded(n);
  // What is beyond n or above the diagonal means nothing: it may not even be read by an operation.
  std::vector<double> A(static_cast<std::size_t>(m) * static_cast<std::size_t>(m),
                        std::numeric_limits<double>::signaling_NaN());
  for (int c = 0; c < n; ++c)
    for (int r = c; r < n; ++r) A[static_cast<std::size_t>(c * m + r)] = S(r, c);  // the lower triangle alone
  return A;
}

/// S x = b by dense_cholesky.
Eigen::VectorXd solved(const Eigen::MatrixXd& S, const Eigen::VectorXd& b) {
  const int n = static_cast<int>(b.size());
  auto A = padded_copy(S);
  dense_cholesky solver;
  std::feclearexcept(FE_ALL_EXCEPT);
  REQUIRE(solver.factorise(A.data(), n));
  std::vector<double> x(static_cast<std::size_t>(dense_cholesky::padded(n)), 3.0);
  for (int i = 0; i < n; ++i) x[static_cast<std::size_t>(i)] = b[i];
  solver.solve(x.data());
  CHECK(std::fetestexcept(FE_INVALID) == 0);
  return Eigen::Map<Eigen::VectorXd>(x.data(), n);
}

TEST_CASE("dense: every size up to a few tiles, and larger") {
  for (const int n : {1, 2, 5, 6, 7, 8, 9, 15, 16, 17, 24, 36, 60, 100, 180, 255}) {
    CAPTURE(n);
    const Eigen::MatrixXd S = symmetric(n, 2 * n + 5, static_cast<unsigned>(n));
    const Eigen::VectorXd b = random_matrix(n, 1, 7);
    const Eigen::VectorXd expected = S.llt().solve(b), got = solved(S, b);
    CHECK((got - expected).norm() < 1e-8 * expected.norm());
    CHECK((S * got - b).norm() < 1e-11 * b.norm() * n);
  }
}

TEST_CASE("dense: rows that begin with zeros") {
  for (unsigned seed = 0; seed < 8; ++seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> length(1, 40);
    constexpr int n = 123;
    Eigen::MatrixXd S = Eigen::MatrixXd::Identity(n, n);
    for (int k = 0; k < 200; ++k) {  // factors of neighbours, and some of the last unknowns with any
      const int from = length(random) * 3, count = std::min(k % 5 == 0 ? 2 : 9, n - from);
      Eigen::VectorXd J = Eigen::VectorXd::Zero(n);
      J.segment(from, count) = random_matrix(count, 1, static_cast<unsigned>(k));
      if (k % 5 == 0) J[n - 1 - k % 9] = 2;
      S += J * J.transpose();
    }
    const Eigen::VectorXd b = random_matrix(n, 1, 7);
    const Eigen::VectorXd expected = S.llt().solve(b), got = solved(S, b);
    CHECK((got - expected).norm() < 1e-11 * expected.norm());
  }
}

TEST_CASE("a tiled matrix has room for what is joined and for what a factorisation fills, and no more") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    constexpr int n = 83, tile = turbomap::tiled_matrix::tile, tiles = (n + tile - 1) / tile;
    std::uniform_int_distribution<int> unknown(0, n - 1);
    std::vector<char> filled(tiles * tiles, 0);
    const auto at = [&](int i, int j) -> char& { return filled[static_cast<std::size_t>(i * tiles + j)]; };
    turbomap::tiled_matrix matrix;
    matrix.reset(12);  // what was there before is lost
    matrix.join(11, 0);
    matrix.lay_out();
    matrix.reset(n);
    for (int i = 0; i < tiles; ++i) at(i, i) = 1;
    for (int k = 0; k < 12; ++k) {
      const int a = unknown(random), b = unknown(random);
      matrix.join(a, b);
      at(std::max(a, b) / tile, std::min(a, b) / tile) = 1;
    }
    for (int j = 0; j < tiles; ++j)  // elimination: all that a column joins is joined then
      for (int i = j + 1; i < tiles; ++i)
        for (int k = j + 1; k <= i; ++k)
          if (at(i, j) != 0 && at(k, j) != 0) at(i, k) = 1;
    matrix.lay_out();
    matrix.clear();
    CHECK(matrix.size() == n);
    REQUIRE(matrix.tiles() == tiles);
    std::vector<const double*> places;
    for (int i = 0; i < tiles; ++i) {
      int first = i;
      for (int j = i; j >= 0; --j) {
        CHECK(matrix.has(i, j) == (at(i, j) != 0));
        if (at(i, j) == 0) continue;
        first = j;
        places.push_back(matrix.in(i, j));
        for (int k = 0; k < tile * tile; ++k)
          CHECK(matrix.in(i, j)[k] == (i == j && k % (tile + 1) == 0 && i * tile + k % tile >= n ? 1 : 0));
      }
      CHECK(matrix.first(i) == first);
    }
    std::sort(places.begin(), places.end());
    for (std::size_t k = 1; k < places.size(); ++k) CHECK(places[k] - places[k - 1] == tile * tile);
  }
}

TEST_CASE("frames' other unknowns first: the same system, zero tiles left out") {
  constexpr int V = 6, D = 15;
  for (const int frames : {1, 2, 3, 7, 8, 13}) {
    CAPTURE(frames);
    const int n = frames * D;
    const Eigen::MatrixXd full = symmetric(n, 2 * n, 3);
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n, n);  // all poses are joined, and neighbours in all unknowns
    const auto joined = [](int a, int b) { return b - a <= 1 ? D : V; };
    for (int a = 0; a < frames; ++a)
      for (int b = a; b < frames; ++b) {
        const int count = joined(a, b);
        S.block(a * D, b * D, count, count) = full.block(a * D, b * D, count, count);
        S.block(b * D, a * D, count, count) = full.block(b * D, a * D, count, count);
      }
    S.diagonal().array() += 3 * n;
    const turbomap::unknown_order<V, D> order{frames};
    dense_cholesky solver;
    auto& matrix = solver.matrix();
    matrix.reset(n);
    for (int a = 0; a < frames; ++a)
      for (int b = a; b < frames; ++b) order.join(a, b, joined(a, b), matrix);
    matrix.lay_out();
    matrix.clear();
    std::vector<int> at(static_cast<std::size_t>(n), -1);
    for (int f = 0; f < frames; ++f)
      for (int u = 0; u < D; ++u) at[static_cast<std::size_t>(order.place(f, u))] = f * D + u;
    CHECK(*std::min_element(at.begin(), at.end()) == 0);
    CHECK(at[0] == 6);                                           // of frame 0 the first that no landmark sees
    CHECK(at[static_cast<std::size_t>(frames * (D - V))] == 0);  // then the poses
    for (int a = 0; a < frames; ++a)
      for (int b = a; b < frames; ++b) {
        const int count = joined(a, b), stride = count + 2;
        std::vector<double> block(static_cast<std::size_t>(stride * stride), std::numeric_limits<double>::quiet_NaN());
        for (int r = 0; r < count; ++r)
          for (int c = a == b ? r : 0; c < count; ++c)
            block[static_cast<std::size_t>(r * stride + c)] = S(a * D + r, b * D + c);
        order.put(a, b, count, block.data(), stride, matrix);
      }
    int zeros = 0;
    for (int p = 0; p < n; ++p)
      for (int q = p; q < n; ++q) {
        const int a = at[static_cast<std::size_t>(p)], b = at[static_cast<std::size_t>(q)];
        const double expected =
            S(std::min(a, b), std::max(a, b));  // of the half that was given: the other may be rounded otherwise
        const bool has = matrix.has(q / 8, p / 8);
        zeros += has ? 0 : 1;
        CHECK((has ? matrix.at(q, p) : 0) == expected);
      }
    CHECK((zeros > 0) == (frames > 2));
    std::vector<double> x(static_cast<std::size_t>(n)), y(x.size() + 8), z(x.size());
    for (int i = 0; i < n; ++i) x[static_cast<std::size_t>(i)] = i;
    order.vector(x.data(), y.data());
    CHECK(y[0] == 6);
    order.restore(y.data(), z.data());
    CHECK(x == z);
    REQUIRE(solver.factorise_matrix(1e-12));
    solver.solve(y.data());
    order.restore(y.data(), z.data());
    const Eigen::VectorXd expected = S.llt().solve(Eigen::Map<Eigen::VectorXd>(x.data(), n));
    CHECK((Eigen::Map<Eigen::VectorXd>(z.data(), n) - expected).norm() < 1e-12 * expected.norm());
  }
}

TEST_CASE("dense: singular, indefinite, not a number") {
  for (const int n : {6, 20, 90}) {
    dense_cholesky solver;
    auto A = padded_copy(symmetric(n, n - 4, 1));
    CHECK_FALSE(solver.factorise(A.data(), n));
    const Eigen::MatrixXd damped = symmetric(n, n - 4, 1) + 1e-3 * Eigen::MatrixXd::Identity(n, n);
    A = padded_copy(damped);
    CHECK(solver.factorise(A.data(), n));
    A = padded_copy(Eigen::MatrixXd(damped - 2 * Eigen::MatrixXd::Identity(n, n)));
    CHECK_FALSE(solver.factorise(A.data(), n));
    A = padded_copy(damped);
    A[static_cast<std::size_t>(n - 1)] = std::numeric_limits<double>::quiet_NaN();
    CHECK_FALSE(solver.factorise(A.data(), n));
    A = padded_copy(Eigen::MatrixXd::Zero(n, n));
    CHECK_FALSE(solver.factorise(A.data(), n));
  }
}

/// A thread for each index: of a pool, one may do all the work, and the thread sanitizer would see nothing.
struct own_threads : thrust::cpp::execution_policy<own_threads> {};
template <class Iterator, class Size, class Function>
Iterator for_each_n(own_threads&, Iterator first, Size n, Function f) {
  std::vector<std::thread> threads;
  for (Size i = 0; i < n; ++i) threads.emplace_back([=] { f(*(first + i)); });
  for (std::thread& t : threads) t.join();
  return first + n;
}

TEST_CASE_TEMPLATE("dense: by threads, the same bits and the same refusals", Policy, TURBOMAP_TEST_POLICIES,
                   own_threads) {
  dense_cholesky alone, shared;
  for (const int n : {0, 5, 60, 64, 100, 180, 255}) {
    const Eigen::MatrixXd first = symmetric(n, 2 * n + 5, static_cast<unsigned>(n));
    for (int repeat = 0; repeat < 20; ++repeat) {
      CAPTURE(n);
      const Eigen::MatrixXd S = first + repeat * Eigen::MatrixXd::Identity(n, n);
      auto A = padded_copy(S), B = A;
      REQUIRE(alone.factorise(A.data(), n));
      REQUIRE(shared.factorise(Policy{}, B.data(), n));
      std::vector<double> x(A.size() + 8, 1.0), y = x;
      alone.solve(x.data()), shared.solve(y.data());
      CHECK(x == y);
      if (n < 60) continue;
      A = padded_copy(S);
      A[static_cast<std::size_t>((7 * repeat % n) * (dense_cholesky::padded(n) + 1))] = -1;
      CHECK_FALSE(shared.factorise(Policy{}, A.data(), n));
    }
  }
}

template <int D>
void check_sparse(int n, double density, unsigned seed) {
  CAPTURE(n);
  CAPTURE(density);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<std::int32_t> row, column;
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(n * D, n * D);
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j)
      if (uniform(random) < density || (j == i + 1 && density > 0)) {
        row.push_back(i), column.push_back(j);
        const Eigen::MatrixXd J = random_matrix(D + 3, 2 * D, static_cast<unsigned>(i * n + j));
        const Eigen::MatrixXd H = J.transpose() * J;
        S.block(i * D, i * D, D, D) += H.topLeftCorner(D, D), S.block(j * D, j * D, D, D) += H.bottomRightCorner(D, D);
        S.block(i * D, j * D, D, D) = H.topRightCorner(D, D), S.block(j * D, i * D, D, D) = H.bottomLeftCorner(D, D);
      }
  const auto blocks = [&](const Eigen::MatrixXd& M) {
    std::vector<double> result;
    const auto add = [&](int i, int j) {
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c) result.push_back(M(i * D + r, j * D + c));
    };
    for (int i = 0; i < n; ++i) add(i, i);
    for (std::size_t k = 0; k < row.size(); ++k) add(row[k], column[k]);
    return result;
  };
  const Eigen::MatrixXd damped = S + 0.1 * Eigen::MatrixXd::Identity(n * D, n * D);
  block_cholesky<D> solver;
  solver.analyse(n, row, column);
  CHECK(solver.fill() >= row.size());
  CHECK(solver.fill() <= static_cast<std::size_t>(n * (n - 1) / 2));
  REQUIRE(solver.factorise(blocks(damped).data()));
  Eigen::VectorXd b = random_matrix(n * D, 1, 9), x = b;
  solver.solve(x.data());
  CHECK((damped * x - b).norm() < 1e-9 * b.norm());
  Eigen::MatrixXd singular = damped;
  singular.row(n * D - 1).setZero(), singular.col(n * D - 1).setZero();
  CHECK_FALSE(solver.factorise(blocks(singular).data()));
  CHECK_FALSE(solver.factorise(blocks(Eigen::MatrixXd(-damped)).data()));
  REQUIRE(solver.factorise(blocks(damped).data()));  // and again
  x = b;
  solver.solve(x.data());
  CHECK((damped * x - b).norm() < 1e-9 * b.norm());
}

TEST_CASE("sparse: any structure") {
  for (const int n : {1, 2, 5, 12, 40})
    for (const double density : {0.0, 0.05, 0.4, 1.0}) {
      check_sparse<6>(n, density, 3);
      check_sparse<9>(n, density, 4);
      check_sparse<3>(n, density, 5);
    }
}

TEST_CASE("sparse: a star is eliminated from its ends, without fill") {
  std::vector<std::int32_t> row(30, 0), column;
  for (int i = 1; i <= 30; ++i) column.push_back(i);
  block_cholesky<6> solver;
  solver.analyse(31, row, column);
  CHECK(solver.fill() == 30);
}

}  // namespace
