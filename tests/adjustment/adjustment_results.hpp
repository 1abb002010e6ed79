// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How two results of an adjustment compare: whether they are the same to the last bit, and how far they are apart.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/options.hpp>
#include <turbomap/math/linear.hpp>
#include <turbomap/types.hpp>

#include "reference/larger_or_nan.hpp"

namespace turbomap_test {

/// Not ==, to which zeros of both signs are equal and NaN is not itself.
/// \tparam List  a list of plain data without padding
template <class List, class T = typename List::value_type>
bool same_bits(const List& a, const List& b) {
  static_assert(std::is_trivially_copyable_v<T>);
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}
inline bool same_bits(const turbomap::adjustment_summary& a, const turbomap::adjustment_summary& b) {
  static_assert(sizeof(turbomap::adjustment_iteration) == 2 * sizeof(double) + 2 * sizeof(int));
  return same_bits(std::vector<double>{a.cost_initial, a.cost_final},
                   std::vector<double>{b.cost_initial, b.cost_final}) &&
         a.iterations == b.iterations && a.accepted == b.accepted && a.undefined == b.undefined && a.end == b.end &&
         same_bits(a.each, b.each);
}

/// The largest difference of an element, metres and quaternions. NaN where a result holds one.
inline double distance(const std::vector<turbomap::rigid_transform<double>>& a,
                       const std::vector<turbomap::rigid_transform<double>>& b) {
  if (a.size() != b.size()) return HUGE_VAL;
  double d = 0;
  for (std::size_t f = 0; f < a.size(); ++f) {
    const auto &p = a[f], &q = b[f];
    for (const double x : {p.qx - q.qx, p.qy - q.qy, p.qz - q.qz, p.qw - q.qw, p.tx - q.tx, p.ty - q.ty, p.tz - q.tz})
      d = larger_or_nan(d, std::abs(x));
  }
  return d;
}
/// The largest distance of two points: metres; beyond 1 m from the origin, relative to that. NaN where a result holds
/// one.
inline double distance(const std::vector<turbomap::vec3<double>>& a, const std::vector<turbomap::vec3<double>>& b) {
  using turbomap::operator-;
  if (a.size() != b.size()) return HUGE_VAL;
  double d = 0;
  for (std::size_t l = 0; l < a.size(); ++l)
    d = larger_or_nan(d, turbomap::norm(a[l] - b[l]) / std::max(1.0, turbomap::norm(b[l])));
  return d;
}

}  // namespace turbomap_test
