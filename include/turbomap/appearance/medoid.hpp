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
#include <utility>

#include "../config.hpp"
#include "../descriptor/binary.hpp"
#include "../descriptor/four_distances.hpp"
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

/// Distances of one descriptor to all, computed whenever they are asked for: no memory, for any number of descriptors. `keys(j)`
/// is the distance of the row's descriptor to number j.
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

/// The distances of n descriptors to each other. Each row is padded with the largest key to a multiple of `step`.
template <class Key>
struct distance_table {
  static constexpr int step = 16;
  const Key* keys;
  int n, stride;

  /// Which of the rows has the least median, as least_median(): by bisection of the values, the least bound within which `needed` keys
  /// of any row lie.
  int least_median() const {
    const Key needed = static_cast<Key>((n - 1) / 2 + 1);
    Key low = std::numeric_limits<Key>::lowest(), high = keys[0];
    for (int j = 1; j < n; ++j) high = keys[j] > high ? keys[j] : high;  // the first row's median is not greater
    while (low < high) {
      const Key middle = midpoint(low, high);
      const bool is_enough = most_within(middle) >= needed;  // no branch on it: nobody could predict it
      high = is_enough ? middle : high;
      low = is_enough ? low : static_cast<Key>(middle + 1);
    }
    return first_within(low, needed);
  }

 private:
  /// Of the rows first ... first + step - 1, how many keys do not exceed the bound. Each row is counted in a lane: a column is a row,
  /// too. Fixed inner loops, so that they become SIMD at every level of optimisation.
  struct counts {
    Key of[step] = {};  // as wide as the keys: one vector

    counts(const distance_table& t, int first, Key bound) {
      const Key* row = t.keys + first;
      for (int j = 0; j < t.n; ++j, row += t.stride)
        for (int l = 0; l < step; ++l) of[l] = static_cast<Key>(of[l] + (row[l] <= bound ? 1 : 0));
    }
  };
  /// Of the row that has most of them. The bound is less than the largest key.
  Key most_within(Key bound) const {
    Key most = 0;
    for (int first = 0; first < stride; first += step) {
      const counts within(*this, first, bound);
      for (int l = 0; l < step; ++l) most = within.of[l] > most ? within.of[l] : most;
    }
    return most;
  }
  int first_within(Key bound, Key needed) const {
    for (int first = 0; first < stride; first += step) {
      const counts within(*this, first, bound);
      for (int l = 0; l < step; ++l)
        if (within.of[l] >= needed) return first + l;
    }
    return 0;
  }
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

/// Fills in the distances of a descriptor to `count` others, which lie one after the other: as a row of a table, and as a column, whose
/// elements are `stride` apart. Three more of everything may be read and overwritten.
template <class Descriptor, class = void>
struct symmetric_row {
  template <class Key>
  static void fill(const typename Descriptor::element* one, const typename Descriptor::element* others, int count,
                   Key* row, Key* column, int stride) {
    for (int j = 0; j < count; ++j)
      column[j * stride] = row[j] =
          static_cast<Key>(distance_order(Descriptor::distance(one, others + j * Descriptor::elements)));
  }
};
#if TURBOMAP_X86_VECTORS && TURBOMAP_VECTOR_BYTES >= 32
/// Four at a time.
template <int Bits>
struct symmetric_row<binary_descriptor<Bits>, std::enable_if_t<counts_bits_of_vectors && Bits % 256 == 0>> {
  static void fill(const std::uint8_t* one, const std::uint8_t* others, int count, std::uint16_t* row,
                   std::uint16_t* column, int stride) {
    const auto apart = [&](int j) {
      return different_bits(one, others + j * (Bits / 8), std::make_index_sequence<Bits / 256>());
    };
    for (int j = 0; j < count; j += 4) {
      const __m128i sums = sums_of_four(apart(j), apart(j + 1), apart(j + 2), apart(j + 3));
      std::uint16_t words[8];
      std::memcpy(words, &sums, sizeof words);
      for (int k = 0; k < 4; ++k) column[(j + k) * stride] = row[j + k] = words[word_of_four[k]];
    }
  }
};
#endif

}  // namespace detail

/// The medoid of descriptors(0) ... descriptors(n - 1), n >= 1, without memory: up to n (n - 1) distances, plus n for
/// each step of the search for a median, of which there are few: a new best row comes ever more seldom.
template <class Descriptor, class Descriptors>
TURBOMAP_HD int medoid_without_memory(int n, const Descriptors& descriptors) {
  using key = detail::distance_key<typename Descriptor::distance_type>;
  if (n <= 2) return 0;  // the median of one or two distances is that to itself
  return detail::least_median<key>(n, detail::computed_rows<Descriptor, Descriptors>{descriptors, n});
}

/// So many descriptors get the table of their distances on the stack (33 KB for binary descriptors, 17 KB for other 32-bit
/// distances, and 8 KB at most for copies of short ones); more go without. Not a limit: the answer is the same.
template <class Descriptor>
inline constexpr int medoid_table_size = sizeof(typename detail::table_key<Descriptor>::type) == 2 ? 128 : 64;

/// The same on the host, which has a stack: each pair is compared once where a table holds the distances. Kernels have their own:
/// cuda/medoid.cuh.
template <class Descriptor, class Descriptors>
int medoid_with_table(int n, const Descriptors& descriptors) {
  using distance = typename Descriptor::distance_type;
  using key = typename detail::table_key<Descriptor>::type;
  using element = typename Descriptor::element;
  constexpr int step = detail::distance_table<key>::step;
  constexpr int most = medoid_table_size<Descriptor>, more = 3;
  static_assert(most % step == 0);
  if (n <= 2 || n > most) return medoid_without_memory<Descriptor>(n, descriptors);
  const int stride = (n + step - 1) / step * step;
  key table[(most + more) * most];
  // Short descriptors are copied first: they come from as many places of memory, and waiting for all of them at once is
  // shorter than for one after the other.
  constexpr bool copied = Descriptor::bytes <= 64;
  alignas(32) element copies[copied ? (most + more) * Descriptor::elements : 1];
  const element* places[copied ? 1 : most];
  if constexpr (copied) {
    for (int i = 0; i < n; ++i)
      std::memcpy(static_cast<void*>(copies + i * Descriptor::elements), descriptors(i), Descriptor::bytes);
    std::memset(static_cast<void*>(copies + n * Descriptor::elements), 0, more * Descriptor::bytes);
  } else {
    for (int i = 0; i < n; ++i) places[i] = descriptors(i);
  }
  for (int i = 0; i < n; ++i) {
    key* row = table + i * stride;
    if constexpr (copied)
      detail::symmetric_row<Descriptor>::fill(copies + i * Descriptor::elements, copies, i, row, table + i, stride);
    else
      for (int j = 0; j < i; ++j)
        table[j * stride + i] = row[j] = static_cast<key>(distance_order(Descriptor::distance(places[i], places[j])));
    row[i] = static_cast<key>(distance_order(distance(0)));
    for (int j = n; j < stride; ++j) row[j] = std::numeric_limits<key>::max();
  }
  return detail::distance_table<key>{table, n, stride}.least_median();
}

TURBOMAP_END_NAMESPACE
