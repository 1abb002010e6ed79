// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The profile factorisation against Eigen's dense one, and what it says of a direction that nothing determines.

#include <doctest/doctest.h>

#include <turbomap/adjustment/profile_cholesky.hpp>

#include <Eigen/Dense>

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace {

using turbomap::plain_vector;
using turbomap::profile_cholesky;

/// A chain of n unknowns: the difference of each to the next is measured; the profile of every second row reaches further back.
Eigen::MatrixXd chain(int n) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  const auto measure = [&A](int i, int j, double weight) {
    A(i, i) += weight, A(j, j) += weight, A(i, j) -= weight, A(j, i) -= weight;
  };
  for (int i = 1; i < n; ++i) measure(i, i - 1, 1 + 0.25 * i);
  for (int i = 4; i < n; i += 2) measure(i, i - 3, 0.5);
  return A;
}
plain_vector<std::uint8_t> factorise(const Eigen::MatrixXd& A, profile_cholesky& factor) {
  const int n = static_cast<int>(A.rows());
  plain_vector<std::int32_t> first;
  for (int i = 0; i < n; ++i) {
    int j = 0;
    while (j < i && A(i, j) == 0) ++j;
    first.push_back(j);
  }
  factor.reset(first);
  for (int i = 0; i < n; ++i)
    for (int j = first[static_cast<std::size_t>(i)]; j <= i; ++j) factor.row(i)[j] = A(i, j);
  plain_vector<std::uint8_t> undetermined;
  factor.factorise(0, undetermined);
  return undetermined;
}

TEST_CASE("a chain with a free end is undetermined as a whole; what is apart from it is solved as by a dense solver") {
  constexpr int n = 8, apart = 4;
  for (const bool held : {false, true}) {
    CAPTURE(held);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n + apart, n + apart);
    A.topLeftCorner(n, n) = chain(n);
    A.bottomRightCorner(apart, apart) = chain(apart) + 0.125 * Eigen::MatrixXd::Identity(apart, apart);
    if (held) A(0, 0) += 1e-6;  // weakly, but told
    profile_cholesky factor;
    const auto undetermined = factorise(A, factor);
    for (int i = 0; i < n + apart; ++i) CHECK(undetermined[static_cast<std::size_t>(i)] == (i < n && !held ? 1 : 0));

    const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(n + apart, -1, 2);
    Eigen::VectorXd b = A * x;
    plain_vector<long double> solution;
    for (int i = 0; i < n + apart; ++i) solution.push_back(b[i]);
    factor.solve(solution);
    // Dense, without the null direction: the unknown that is taken out is 0, the last of the chain.
    if (!held) A.row(n - 1).setZero(), A.col(n - 1).setZero(), A(n - 1, n - 1) = 1, b[n - 1] = 0;
    const Eigen::VectorXd dense = A.fullPivLu().solve(b);
    for (int i = 0; i < n + apart; ++i)
      CHECK(std::abs(static_cast<double>(solution[static_cast<std::size_t>(i)]) - dense[i]) < 1e-8);
  }
}

}  // namespace
