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

/// What a factor depends on: a landmark or a free frame, and the derivatives of its residuals by that.
struct factor_unknown {
  int index = -1;              ///< -1: none, or a fixed one
  const double* by = nullptr;  ///< [residual][column]
};

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
  void add(int size, double w, int V, const factor_unknown& l, const factor_unknown& a, const factor_unknown& b = {}) {
    if (l.index < 0 && a.index < 0 && b.index < 0) return;
    const double root = std::sqrt(w);
    bool finite = detail::is_finite(root);
    for (int i = 0; i < size * V; ++i)
      finite = finite && (a.index < 0 || detail::is_finite(a.by[i])) && (b.index < 0 || detail::is_finite(b.by[i]));
    for (int i = 0; i < 3 * size && l.index >= 0; ++i) finite = finite && detail::is_finite(l.by[i]);
    if (!finite) {
      for (const int frame : {a.index, b.index})
        if (frame >= 0) spoilt.push_back(frame);
      return;
    }
    for (int k = 0; k < size; ++k) {
      landmark.push_back(l.index), first.push_back(a.index), second.push_back(b.index);
      for (int i = 0; i < 3; ++i) d_landmark.push_back(l.index < 0 ? 0 : root * l.by[3 * k + i]);
      for (int i = 0; i < D; ++i) {
        d_first.push_back(a.index >= 0 && i < V ? root * a.by[k * V + i] : 0);
        d_second.push_back(b.index >= 0 && i < V ? root * b.by[k * V + i] : 0);
      }
    }
  }
};

TURBOMAP_END_NAMESPACE
