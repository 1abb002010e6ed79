// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Residuals and factors of inertial states, evaluated where a policy computes: zero where prediction says, with the
/// derivatives of dual numbers, and equal to those of the host.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <random>
#include <vector>

#include <turbomap/inertial/inertial_factors.hpp>
#include <turbomap/inertial/inertial_residual.hpp>
#include <turbomap/inertial/marginal_prior.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/math/dual.hpp>

#include "preintegration_cases.hpp"
#include "reference/larger_or_nan.hpp"
#include "support/evaluate.hpp"

namespace turbomap_test {

using turbomap::inertial_state;
using turbomap::isometry;

/// Two states some way off from what was measured, on any pose; the second bias has its own value. What is known of
/// them, for the factors of one frame.
struct inertial_case {
  preintegration<double> p;
  isometry<double> T_bc;
  inertial_state<double> i, j;
  vec3<double> gravity;
  turbomap::inertial_factor::row edge;
  turbomap::inertial_prior_factor::row known;
  turbomap::marginal_prior_factor::row marginal;
};

inline inertial_case make_inertial_case(unsigned seed, double off) {
  std::mt19937_64 random(seed);
  const imu_motion m = make_imu_motion(seed, 300, 1);
  inertial_case c{};
  c.p = turbomap::preintegrate(m.samples(), m.intervals[0], m.biases[0], {});
  c.T_bc = {turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 0.2)};
  c.i.T_cw = turbomap::to_rigid_transform(
      isometry<double>{turbomap::rotation_exp(random_vector(random, 2)), random_vector(random, 5)});
  c.i.velocity = random_vector(random, 2);
  c.i.bias = {m.biases[0].gyro + random_vector(random, 0.05), m.biases[0].acceleration + random_vector(random, 0.3)};
  c.gravity = turbomap::rotation_exp(random_vector(random, 3)) * vec3<double>{0, 0, -9.81};
  c.j = turbomap::predict(c.i, c.p, c.gravity, c.T_bc);
  c.marginal.at = c.j;
  double step[15];
  std::uniform_real_distribution<double> u(-off, off), one(-1, 1);
  for (double& x : step) x = u(random);
  c.j = turbomap::move_state(step, c.j);
  turbomap::make_inertial_row(c.p, 1, c.edge);
  c.known = {random_vector(random, 1), {random_vector(random, 0.1), random_vector(random, 0.1)}, 3, 100, 10};
  for (double& x : c.marginal.R) x = one(random);
  for (double& x : c.marginal.e) x = one(random);
  return c;
}

inline std::vector<inertial_case> make_inertial_cases() {
  std::vector<inertial_case> all;
  for (const double off : {0.0, 0.1, 1.5})
    for (unsigned seed = 0; seed < 20; ++seed) all.push_back(make_inertial_case(seed, off));
  return all;
}

struct nine_residuals {
  double r[9];
};
struct evaluate_residual {
  TURBOMAP_HD void operator()(const inertial_case& c, nine_residuals& to) const {
    turbomap::inertial_residual(c.p, c.T_bc, c.i, c.j, c.gravity, to.r);
  }
};

/// What was predicted has no residual.
template <class Policy>
void check_predicted(const Policy& policy) {
  std::vector<inertial_case> cases;
  for (unsigned seed = 0; seed < 20; ++seed) cases.push_back(make_inertial_case(seed, 0));
  for (const auto& got : evaluate<evaluate_residual, nine_residuals>(policy, cases))
    for (const double x : got.r) CHECK(std::abs(x) < 1e-12);
}

struct derivative_error {
  double worst;
};
/// How far residuals and analytic derivatives are from those of dual numbers; derivatives relative to 1 + their size.
struct compare_with_duals {
  TURBOMAP_HD void operator()(const inertial_case& c, derivative_error& to) const {
    using dual = turbomap::dual<32>;  // both states, direction of gravity
    double r[9];
    turbomap::inertial_jacobian J;
    turbomap::linearise_inertial_residual(c.p, c.T_bc, c.i, c.j, c.gravity, r, J);
    dual step[32], expected[9];
    for (int k = 0; k < 32; ++k) step[k] = dual::variable(0, k);
    turbomap::inertial_residual(c.p, c.T_bc, turbomap::move_state(step, c.i), turbomap::move_state(step + 15, c.j),
                                turbomap::turn_gravity(c.gravity, step + 30), expected);
    to.worst = 0;
    for (int row = 0; row < 9; ++row) {
      note(r[row] - expected[row].a, 1, to.worst);
      for (int k = 0; k < 32; ++k) {
        const double d = k < 15 ? J.i[15 * row + k] : k < 30 ? J.j[15 * row + k - 15] : J.gravity[2 * row + k - 30];
        note(d - expected[row].d[k], 1 + (d < 0 ? -d : d), to.worst);
      }
    }
  }
  TURBOMAP_HD static void note(double difference, double size, double& worst) {
    worst = larger_or_nan(worst, (difference < 0 ? -difference : difference) / size);
  }
};

/// Derivatives are those of dual numbers.
template <class Policy>
void check_derivatives(const Policy& policy) {
  const auto cases = make_inertial_cases();
  const auto got = evaluate<compare_with_duals, derivative_error>(policy, cases);
  for (std::size_t k = 0; k < got.size(); ++k) {
    CAPTURE(k);
    CHECK(got[k].worst < 1e-11);
  }
}

/// Every residual of inertial states with its derivatives, all of them numbers.
struct inertial_values {
  double r[9];
  turbomap::inertial_jacobian J;
  double edge[9], edge_i[9 * 15], edge_j[9 * 15];
  double walk[6], walk_i[6 * 15], walk_j[6 * 15];
  double known[9], known_d[9 * 15];
  double marginal[15], marginal_d[15 * 15];
};
struct evaluate_factors {
  TURBOMAP_HD void operator()(const inertial_case& c, inertial_values& to) const {
    turbomap::linearise_inertial_residual(c.p, c.T_bc, c.i, c.j, c.gravity, to.r, to.J);
    turbomap::inertial_factor factor;
    factor.T_bc = c.T_bc, factor.gravity = c.gravity;
    factor.linearise(c.i, c.j, c.edge, to.edge, to.edge_i, to.edge_j);
    turbomap::bias_walk_factor{}.linearise(c.i, c.j, {1e3, 1e2}, to.walk, to.walk_i, to.walk_j);
    turbomap::inertial_prior_factor{}.linearise(c.j, c.known, to.known, to.known_d);
    turbomap::marginal_prior_factor{}.linearise(c.j, c.marginal, to.marginal, to.marginal_d);
  }
};

/// The largest size of a number.
template <std::size_t Count>
double largest_size(const double (&x)[Count]) {
  double size = 0;
  for (const double v : x) size = std::max(size, std::abs(v));
  return size;
}
/// The largest difference, relative to the largest number in b or to `least`. NaN where a result holds one.
template <std::size_t Count>
double difference_of_lists(const double (&a)[Count], const double (&b)[Count], double least = 1) {
  double worst = 0;
  for (std::size_t n = 0; n < Count; ++n) worst = larger_or_nan(worst, std::abs(a[n] - b[n]));
  return worst / std::max(least, largest_size(b));
}

/// Residuals and derivatives of every factor are those of the host: within 1e-12 of the largest number of a list, 1
/// at least. (2e-14 was measured between -ffp-contract=off and fused multiply-add.) A whitened residual is a small
/// difference of numbers around 1 times a large weight, so it is compared with the weight.
template <class Policy>
void check_factors(const Policy& policy) {
  const auto cases = make_inertial_cases();
  const auto got = evaluate<evaluate_factors, inertial_values>(policy, cases);
  for (std::size_t k = 0; k < got.size(); ++k) {
    CAPTURE(k);
    inertial_values expected;
    evaluate_factors{}(cases[k], expected);
    const auto& a = got[k];
    const auto& b = expected;
    CHECK(difference_of_lists(a.r, b.r) < 1e-12);
    CHECK(difference_of_lists(a.J.i, b.J.i) < 1e-12);
    CHECK(difference_of_lists(a.J.j, b.J.j) < 1e-12);
    CHECK(difference_of_lists(a.J.gravity, b.J.gravity) < 1e-12);
    CHECK(difference_of_lists(a.edge, b.edge, largest_size(cases[k].edge.whitening)) < 1e-12);
    CHECK(difference_of_lists(a.edge_i, b.edge_i) < 1e-12);
    CHECK(difference_of_lists(a.edge_j, b.edge_j) < 1e-12);
    CHECK(difference_of_lists(a.walk, b.walk) < 1e-12);
    CHECK(difference_of_lists(a.walk_i, b.walk_i) < 1e-12);
    CHECK(difference_of_lists(a.walk_j, b.walk_j) < 1e-12);
    CHECK(difference_of_lists(a.known, b.known) < 1e-12);
    CHECK(difference_of_lists(a.known_d, b.known_d) < 1e-12);
    CHECK(difference_of_lists(a.marginal, b.marginal) < 1e-12);
    CHECK(difference_of_lists(a.marginal_d, b.marginal_d) < 1e-12);
  }
  const auto again = evaluate<evaluate_factors, inertial_values>(policy, cases);
  CHECK(std::memcmp(again.data(), got.data(), got.size() * sizeof got[0]) == 0);
}

}  // namespace turbomap_test
