// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A recorded linear system through the library's own Schur complement, reduced solver and back-substitution, compared
/// with what was recorded.

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/adjustment/dense_cholesky.hpp>
#include <turbomap/context.hpp>
#include "readers/schur_system.hpp"

#include "recorded_schur.hpp"
#include "solve.hpp"

namespace turbomap_bundle {

/// What the comparison has to hold.
struct schur_bounds {
  double hschur = 1e-12;  ///< ||ours - recorded|| / ||recorded||, upper triangle
  double bschur = 1e-9;
  double xl = 1e-7;         ///< from the recorded xp
  double residual = 1e-10;  ///< ||Hschur xp - bschur|| / ||bschur||, recorded ones
  double pivot = 1e-6;      ///< a pivot below it times its diagonal element: singular (gauge ones: 2e-7, others: 2e-3)
  double damping = 1e-8;    ///< relative to the largest diagonal element: with it, the system must have a solution
  double damped = 1e-9;     ///< ||(S + lambda I) x - rhs|| / ||rhs||
};

inline double norm(const std::vector<double>& v) {
  return std::sqrt(std::inner_product(v.begin(), v.end(), v.begin(), 0.0));
}
inline double relative_difference(std::vector<double> a, const std::vector<double>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return norm(a) / norm(b);
}

/// ||A x - b|| / ||b|| of a row-major square matrix.
inline double relative_residual(const std::vector<double>& A, const std::vector<double>& x,
                                const std::vector<double>& b) {
  std::vector<double> r(b.size());
  for (std::size_t i = 0; i < b.size(); ++i) {
    long double sum = 0;
    for (std::size_t j = 0; j < x.size(); ++j) sum += static_cast<long double>(A[i * x.size() + j]) * x[j];
    r[i] = static_cast<double>(sum - b[i]);
  }
  return norm(r) / norm(b);
}

template <class Policy>
nlohmann::json check_schur(const Policy& policy, const turbomap::schur_system& s, int repeat,
                           const schur_bounds& bounds = {}) {
  turbomap::context<Policy> ctx(policy);
  const stopwatch setup;
  recorded_schur<Policy> ours(ctx, s);
  const double ms_setup = setup.ms();
  const auto n = static_cast<std::size_t>(ours.size());
  const auto recorded = s.hschur.dense(true);
  std::vector<double> S, rhs, times;
  for (int i = 0; i < repeat; ++i) {
    const stopwatch one;
    ours.reduce(0, S, rhs);
    times.push_back(one.ms());
  }
  if (repeat > 1) times.erase(times.begin());  // as of every problem
  const double hschur = relative_difference(S, recorded), bschur = relative_difference(rhs, s.bschur);
  const double residual = relative_residual(recorded, s.xp, s.bschur);
  const double xl = relative_difference(ours.substitute(s.xp), s.xl);

  // Our own factorisation: singular as it is, solvable with damping.
  turbomap::dense_cholesky cholesky;
  const auto pad = [&](const std::vector<double>& m) {
    const auto stride = static_cast<std::size_t>(turbomap::dense_cholesky::padded(ours.size()));
    std::vector<double> padded(stride * stride, 0.0);
    for (std::size_t i = 0; i < n; ++i)
      std::copy_n(m.begin() + static_cast<std::ptrdiff_t>(i * n), n,
                  padded.begin() + static_cast<std::ptrdiff_t>(i * stride));
    return padded;
  };
  auto factor = pad(S);
  const bool singular = !cholesky.factorise(factor.data(), ours.size(), bounds.pivot);
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, S[i * n + i]);
  const double lambda = bounds.damping * largest;
  ours.reduce(lambda, S, rhs);
  factor = pad(S);
  const bool solved = cholesky.factorise(factor.data(), ours.size(), bounds.pivot);
  auto x = rhs;
  x.resize(factor.size() / static_cast<std::size_t>(turbomap::dense_cholesky::padded(ours.size())));
  if (solved) cholesky.solve(x.data());
  x.resize(n);
  const double damped = solved ? relative_residual(S, x, rhs) : HUGE_VAL;
  return {{"unknowns", n},
          {"landmarks", s.xl.size() / 3},
          {"hschur_error", hschur},
          {"bschur_error", bschur},
          {"xl_error", xl},
          {"recorded_residual", residual},
          {"singular", singular},
          {"damping", lambda},
          {"damped_residual", damped},
          {"ms_setup", ms_setup},
          {"ms_reduce", median(times)},
          {"good", hschur <= bounds.hschur && bschur <= bounds.bschur && xl <= bounds.xl &&
                       residual <= bounds.residual && singular && solved && damped <= bounds.damped}};
}

}  // namespace turbomap_bundle
