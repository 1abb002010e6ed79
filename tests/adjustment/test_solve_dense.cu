// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Full systems on a device: the solution of the host, the same bits each time, and no solution where there is none.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>
#include <thrust/system/cuda/execution_policy.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <turbomap/adjustment/dense_cholesky.hpp>
#include <turbomap/adjustment/solve_dense.hpp>
#include <turbomap/context.hpp>

#include "adjustment_results.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/stream.cuh"

namespace {

using namespace turbomap_test;
using turbomap::dense_cholesky;

/// A matrix of n unknowns, positive definite with eigenvalues from 1 to about n, and a right hand side.
struct random_equations {
  int n, stride;
  std::vector<double> S, b;

  explicit random_equations(int unknowns) : n(unknowns), stride(dense_cholesky::padded(unknowns)) {
    std::mt19937 random(static_cast<unsigned>(n));
    std::normal_distribution<double> normal;
    std::vector<double> G(static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
    for (double& g : G) g = normal(random);
    S.assign(static_cast<std::size_t>(stride) * static_cast<std::size_t>(stride), 0);
    for (int j = 0; j < n; ++j)
      for (int i = j; i < n; ++i) {
        double sum = i == j ? n : 0;
        for (int k = 0; k < n; ++k) sum += G[at(i * n + k)] * G[at(j * n + k)];
        S[at(j * stride + i)] = sum;
      }
    b.assign(at(stride), 0);
    for (int i = 0; i < n; ++i) b[at(i)] = normal(random);
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  bool on_host(std::vector<double>& x) const {
    dense_cholesky solver;
    x = b;
    if (!solver.factorise(S.data(), n)) return false;
    solver.solve(x.data());
    return true;
  }
  /// \param frames  of 15 unknowns, of which landmarks see 6; 0: in the order that the matrix has
  bool on_device(std::vector<double>& x, int frames = 0) const {
    const stream on;
    turbomap::context<stream_policy> ctx{on.policy()};
    double* matrix = ctx.scratch<double>(S.size());
    double* side = ctx.scratch<double>(b.size() + 1);
    turbomap::copy_in(ctx.policy(), matrix, S.data(), S.size() * sizeof(double));
    turbomap::copy_in(ctx.policy(), side, b.data(), b.size() * sizeof(double));
    turbomap::dense_equations equations{matrix, side, side + b.size(), n, stride, turbomap::default_pivot_tolerance};
    if (frames > 0) {
      equations.ordered = ctx.scratch<double>(turbomap::dense_equations::ordered_room(stride));
      equations.frames = frames, equations.seen = 6;
    }
    REQUIRE(turbomap::launch_solve_dense(ctx.policy(), equations));
    x.resize(b.size() + 1);
    turbomap::copy_out(ctx.policy(), x.data(), side, x.size() * sizeof(double));
    ctx.synchronize();
    const bool solved = x.back() != 0;
    x.pop_back();
    return solved;
  }
};

TEST_CASE("systems of any size have the solution of the host") {
  for (const int n : {1, 2, 5, 6, 15, 16, 17, 31, 32, 33, 48, 90, 131, 180, 224, 225, 240, 300, 321, 375, 384}) {
    CAPTURE(n);
    const random_equations p(n);
    std::vector<double> host, device, again;
    REQUIRE(p.on_host(host));
    REQUIRE(p.on_device(device));
    double largest = 0;
    for (int i = 0; i < n; ++i)
      largest =
          larger_or_nan(largest, std::abs(device[p.at(i)] - host[p.at(i)]) / std::max(1e-3, std::abs(host[p.at(i)])));
    CHECK(largest < 1e-10);
    CHECK(p.on_device(again));
    CHECK(same_bits(again, device));
  }
}

/// Equations of frames of 15 unknowns: all poses depend on each other, velocities and biases on the neighbours' alone.
random_equations inertial_equations(int frames, bool neighbours) {
  random_equations p(15 * frames);
  std::fill(p.S.begin(), p.S.end(), 0.0);
  std::mt19937 random(static_cast<unsigned>(frames));
  std::normal_distribution<double> normal;
  const auto add = [&](const std::vector<int>& unknowns) {
    std::vector<double> row(unknowns.size());
    for (double& x : row) x = normal(random);
    for (std::size_t a = 0; a < row.size(); ++a)
      for (std::size_t c = 0; c < row.size(); ++c)
        if (unknowns[a] >= unknowns[c]) p.S[p.at(unknowns[c] * p.stride + unknowns[a])] += row[a] * row[c];
  };
  std::vector<int> poses;
  for (int u = 0; u < p.n; ++u) {
    p.S[p.at(u * p.stride + u)] = 1;
    if (u % 15 < 6) poses.push_back(u);
  }
  for (int k = 0; k < p.n; ++k) add(poses);
  for (int f = 0; f + 1 < frames && neighbours; ++f)
    for (int k = 0; k < 15; ++k) {
      std::vector<int> both;
      for (int u = 15 * f; u < 15 * (f + 2); ++u) both.push_back(u);
      add(both);
    }
  return p;
}

TEST_CASE("frames with an IMU are put in order, and have the solution of the host") {
  for (const int frames : {1, 2, 3, 5, 8, 14, 15, 20, 25})
    for (const bool neighbours : {false, true}) {
      CAPTURE(frames);
      CAPTURE(neighbours);
      const random_equations p = inertial_equations(frames, neighbours);
      std::vector<double> host, device, again, plain;
      REQUIRE(p.on_host(host));
      REQUIRE(p.on_device(device, frames));
      REQUIRE(p.on_device(plain));
      double largest = 0, apart = 0;
      for (int i = 0; i < p.n; ++i) {
        const double size = std::max(1e-3, std::abs(host[p.at(i)]));
        largest = larger_or_nan(largest, std::abs(device[p.at(i)] - host[p.at(i)]) / size);
        apart = larger_or_nan(apart, std::abs(plain[p.at(i)] - host[p.at(i)]) / size);
      }
      CHECK(largest < 1e-10);
      CHECK(apart < 1e-10);  // zero tiles in the order that the matrix has
      CHECK(p.on_device(again, frames));
      CHECK(same_bits(again, device));
    }
  random_equations p = inertial_equations(25, true);
  for (const int bad : {0, 7, 374}) {
    CAPTURE(bad);
    p.S[p.at(bad * p.stride + bad)] = std::nan("");
    std::vector<double> x;
    CHECK_FALSE(p.on_device(x, 25));
  }
}

TEST_CASE("no solution is told") {
  for (const int n : {1, 16, 40, 200, 300, 384})
    for (const int bad : {0, n / 2, n - 1})
      for (const double value : {-1.0, 0.0, std::nan(""), HUGE_VAL}) {
        CAPTURE(n);
        CAPTURE(bad);
        CAPTURE(value);
        random_equations p(n);
        p.S[p.at(bad * p.stride + bad)] = value;
        std::vector<double> x;
        CHECK_FALSE(p.on_host(x));
        CHECK_FALSE(p.on_device(x));
      }
}

TEST_CASE("what is too large is left to the host") {
  const stream on;
  turbomap::context<stream_policy> ctx{on.policy()};
  CHECK_FALSE(turbomap::launch_solve_dense(ctx.policy(), {nullptr, nullptr, nullptr, 385, 392, 0}));
  CHECK_FALSE(turbomap::launch_solve_dense(ctx.policy(), {nullptr, nullptr, nullptr, 0, 0, 0}));
  CHECK_FALSE(turbomap::launch_solve_dense(thrust::seq, {nullptr, nullptr, nullptr, 6, 8, 0}));
}

}  // namespace
