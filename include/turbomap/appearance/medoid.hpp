// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The medoid of a set of descriptors: the one with the least median distance to all of them, itself included.
/// Distances become integers of the same order first, so that binary and real descriptors share one selection by
/// counting, which needs no memory, and neither NaN nor -ffast-math can confuse it.

#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "../config.hpp"
#include "../math/functions.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// An integer in the order of the distance. What is not finite counts as farther than everything else.
template <class Distance>
TURBOMAP_HD auto distance_order(Distance d) {
  if constexpr (std::is_integral_v<Distance>) {
    return static_cast<std::common_type_t<Distance, std::int32_t>>(d);
  } else {
    static_assert(sizeof(Distance) == 4 || sizeof(Distance) == 8,
                  "turbomap: the distance_type of a descriptor is an integer, a float or a double");
    using key = std::conditional_t<sizeof(Distance) == 4, std::int32_t, std::int64_t>;
    constexpr key most = std::numeric_limits<key>::max();
    if (!detail::is_finite(d)) return most;
    key bits;
    std::memcpy(&bits, &d, sizeof bits);
    return bits < 0 ? -(bits & most) : bits;  // both zeros become 0
  }
}

namespace detail {

/// Integer type of distance_order().
template <class Distance>
using distance_key = decltype(distance_order(Distance()));

/// The same, or 16 bits where all distances of a descriptor are known to be in [0, 65,000] (`greatest`): a table of them takes
/// half the memory, and twice as many are compared at once.
template <class Descriptor, class = void>
struct table_key {
  using type = distance_key<typename Descriptor::distance_type>;
};
template <class Descriptor>
struct table_key<Descriptor, std::enable_if_t<std::is_integral_v<typename Descriptor::distance_type> &&
                                              (Descriptor::greatest <= 65000)>> {
  using type = std::uint16_t;
};

/// Halfway between two integers, rounded down, without overflow.
template <class Key>
TURBOMAP_HD Key midpoint(Key a, Key b) {
  return static_cast<Key>((a & b) + ((a ^ b) >> 1));
}

/// The keys of a row that are at most a bound: how many, and their range.
template <class Key>
struct key_range {
  int count;
  Key least, most;
};

/// The median of a row, by bisection of the values: the least key that `needed` of the row do not exceed. It lies in `range`.
template <class Key, class Row>
TURBOMAP_HD Key median_key(const Row& row, const key_range<Key>& range, int needed) {
  Key low = range.least, high = range.most;
  while (low < high) {
    const Key middle = midpoint(low, high);
    if (row.count(middle) >= needed)
      high = middle;
    else
      low = middle + 1;
  }
  return low;
}

/// Distances of one descriptor to all, stored: `size` of them, a multiple of `step`; those that pad it out are the
/// largest key. Fixed inner loops, so that they become SIMD at every level of optimisation.
template <class Key>
struct stored_distances {
  static constexpr int step = 16;
  const Key* keys;
  int size;

  TURBOMAP_HD int count(Key bound) const {
    Key lanes[step] = {};  // as wide as the keys: one vector
    for (int i = 0; i < size; i += step)
      for (int l = 0; l < step; ++l) lanes[l] = static_cast<Key>(lanes[l] + (keys[i + l] <= bound ? 1 : 0));
    int inside = 0;
    for (int l = 0; l < step; ++l) inside += static_cast<int>(lanes[l]);
    return inside;
  }
  /// Only a row of `least_count` or more within the bound is looked at twice.
  TURBOMAP_HD key_range<Key> range(Key bound, int least_count) const {
    key_range<Key> r{count(bound), std::numeric_limits<Key>::max(), std::numeric_limits<Key>::lowest()};
    for (int i = 0; i < size && r.count >= least_count; i += step) {
      for (int l = 0; l < step; ++l) {
        const Key key = keys[i + l], capped = key <= bound ? key : r.most;
        r.least = key < r.least ? key : r.least;
        r.most = capped > r.most ? capped : r.most;
      }
    }
    return r;
  }
};

/// The same computed whenever it is asked for: no memory, for any number of descriptors. `keys(j)` is the distance of
/// the row's descriptor to number j.
template <class Key, class Keys>
struct computed_distances {
  Keys keys;
  int size;

  TURBOMAP_HD int count(Key bound) const {
    int inside = 0;
    for (int j = 0; j < size; ++j) inside += keys(j) <= bound ? 1 : 0;
    return inside;
  }
  /// Ends as soon as fewer than `least_count` can be within the bound.
  TURBOMAP_HD key_range<Key> range(Key bound, int least_count) const {
    key_range<Key> r{0, std::numeric_limits<Key>::max(), std::numeric_limits<Key>::lowest()};
    for (int j = 0; j < size && r.count + (size - j) >= least_count; ++j) {
      const Key key = keys(j);
      if (!(key <= bound)) continue;
      ++r.count;
      r.least = key < r.least ? key : r.least;
      r.most = key > r.most ? key : r.most;
    }
    return r;
  }
};

/// Which of n rows has the least median, element floor((n - 1) / 2) of the sorted row; the first of equals. A row whose
/// median cannot beat the best one is dropped by one count; else its median is found by bisection of the values.
template <class Key, class Rows>
TURBOMAP_HD int least_median(int n, const Rows& rows) {
  const int needed = (n - 1) / 2 + 1;  // the median is the least key that so many of the row do not exceed
  int medoid = 0;
  Key bound = std::numeric_limits<Key>::max() - 1;  // where no median is below the largest key, the first row stays
  for (int i = 0; i < n; ++i) {
    const auto row = rows(i);
    const key_range<Key> r = row.range(bound, needed);
    if (r.count < needed) continue;
    const Key low = median_key(row, r, needed);
    medoid = i;
    if (low == std::numeric_limits<Key>::lowest()) break;
    bound = low - 1;
  }
  return medoid;
}

/// Rows of a square table.
template <class Key>
struct stored_rows {
  const Key* table;
  int stride;
  TURBOMAP_HD stored_distances<Key> operator()(int i) const { return {table + i * stride, stride}; }
};

/// Distance of descriptor `i` to number j; `descriptors(j)` points to its elements.
template <class Descriptor, class Descriptors>
struct row_keys {
  const Descriptors& descriptors;
  int i;
  TURBOMAP_HD auto operator()(int j) const {
    using distance = typename Descriptor::distance_type;
    return distance_order(i == j ? distance(0) : Descriptor::distance(descriptors(i), descriptors(j)));
  }
};
template <class Descriptor, class Descriptors>
struct computed_rows {
  using key = distance_key<typename Descriptor::distance_type>;
  const Descriptors& descriptors;
  int n;
  TURBOMAP_HD computed_distances<key, row_keys<Descriptor, Descriptors>> operator()(int i) const {
    return {{descriptors, i}, n};
  }
};

}  // namespace detail

/// The medoid of descriptors(0) ... descriptors(n - 1), n >= 1, without memory: up to n (n - 1) distances, plus n for
/// each step of the search for a median, of which there are few: a new best row comes ever more seldom.
template <class Descriptor, class Descriptors>
TURBOMAP_HD int medoid_without_memory(int n, const Descriptors& descriptors) {
  using key = detail::distance_key<typename Descriptor::distance_type>;
  if (n <= 2) return 0;  // the median of one or two distances is that to itself
  return detail::least_median<key>(n, detail::computed_rows<Descriptor, Descriptors>{descriptors, n});
}

/// So many descriptors get the table of their distances on the stack (32 KB for binary descriptors, 16 KB for other 32-bit
/// distances); more go without. Not a limit: the answer is the same.
template <class Descriptor>
inline constexpr int medoid_table_size = sizeof(typename detail::table_key<Descriptor>::type) == 2 ? 128 : 64;

/// The same where there is a stack: each pair is compared once where a table holds the distances. Not for kernels,
/// whose threads would each get the table in device memory: cuda/compute_appearance.cuh has their own.
template <class Descriptor, class Descriptors>
TURBOMAP_HD int medoid_with_table(int n, const Descriptors& descriptors) {
  using distance = typename Descriptor::distance_type;
  using key = typename detail::table_key<Descriptor>::type;
  using element = typename Descriptor::element;
  constexpr int step = detail::stored_distances<key>::step;
  constexpr int most = medoid_table_size<Descriptor>;
  static_assert(most % step == 0);
  if (n <= 2 || n > most) return medoid_without_memory<Descriptor>(n, descriptors);
  const int stride = (n + step - 1) / step * step;
  key table[most * most];
  // Short descriptors are copied first: they come from as many places of memory, and waiting for all of them at once is
  // shorter than for one after the other.
  constexpr bool copied = Descriptor::bytes <= 64;
  alignas(32) element copies[copied ? most * Descriptor::elements : 1];
  const element* places[copied ? 1 : most];
  for (int i = 0; i < n; ++i)
    if constexpr (copied)
      std::memcpy(static_cast<void*>(copies + i * Descriptor::elements), descriptors(i), Descriptor::bytes);
    else
      places[i] = descriptors(i);
  const auto at = [&](int i) -> const element* {
    if constexpr (copied)
      return copies + i * Descriptor::elements;
    else
      return places[i];
  };
  for (int i = 0; i < n; ++i) {
    key* row = table + i * stride;
    const element* mine = at(i);
    for (int j = 0; j < i; ++j)
      table[j * stride + i] = row[j] = static_cast<key>(distance_order(Descriptor::distance(mine, at(j))));
    row[i] = static_cast<key>(distance_order(distance(0)));
    for (int j = n; j < stride; ++j) row[j] = std::numeric_limits<key>::max();
  }
  return detail::least_median<key>(n, detail::stored_rows<key>{table, stride});
}

TURBOMAP_END_NAMESPACE
