// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The residuals of a problem as a list of single rows, for what looks at them one by one: covariance.hpp.

#include <cmath>
#include <cstdint>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../plain_vector.hpp"

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

TURBOMAP_END_NAMESPACE
