// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sums that a solver takes on the host, whatever its policy: from the first element to the last, each by one compiled
/// body, so that they do not depend on the policy.

#include <cstddef>

#include "../config.hpp"
#include "damping.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// start + x[0] + x[1] + ...
TURBOMAP_ONE_BODY inline double sum_in_order(const double* x, std::size_t n, double start = 0) {
  for (std::size_t i = 0; i < n; ++i) start += x[i];
  return start;
}

/// start + a[0] b[0] + a[1] b[1] + ...
TURBOMAP_ONE_BODY inline double dot_in_order(const double* a, const double* b, std::size_t n, double start) {
  for (std::size_t i = 0; i < n; ++i) start += a[i] * b[i];
  return start;
}

/// start + the sum of b^2 / h, where h is the diagonal of the lower triangles H of D unknowns per frame.
template <int D>
TURBOMAP_ONE_BODY double gain_in_order(const double* H, const double* b, std::size_t n, double start) {
  constexpr std::size_t triangle = D * (D + 1) / 2;
  for (std::size_t i = 0; i < n; ++i) {
    const double h = H[i / D * triangle + (i % D) * (i % D + 3) / 2];
    start += h > 0 ? b[i] * b[i] / h : 0;
  }
  return start;
}

/// start + the sum of damping(h) x^2, where h is the diagonal of the lower triangles H of D unknowns per frame.
template <int D>
TURBOMAP_ONE_BODY double damped_square(const damping& damping, const double* H, const double* x, std::size_t n,
                                       double start) {
  constexpr std::size_t triangle = D * (D + 1) / 2;
  for (std::size_t i = 0; i < n; ++i)
    start += damping(damping.scaled ? H[i / D * triangle + (i % D) * (i % D + 3) / 2] : 0) * x[i] * x[i];
  return start;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
