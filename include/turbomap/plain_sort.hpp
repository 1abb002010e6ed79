// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Sorting and selection in short lists of plain data on the host. std::sort is a dozen functions per type and order, which
/// every user's unit would compile five times over; each of these is one.

#include <cstddef>

namespace turbomap {

/// Sorts `n` elements, equal ones in no particular order. Shell's method with gaps of Knuth [The Art of Computer Programming
/// 5.2.1]: about n^1.3 steps, n^1.5 at worst. For lists of some thousand elements.
/// \param less  a strict weak order, which may throw: then the elements are in some order, one of them perhaps lost
template <class T, class Less>
[[gnu::noinline]] void sort_plain(T* first, std::size_t n, Less less) {
  std::size_t gap = 1;
  while (gap < n / 3) gap = 3 * gap + 1;
  for (; gap > 0; gap /= 3) {
    for (std::size_t i = gap; i < n; ++i) {
      const T moved = first[i];
      std::size_t to = i;
      for (; to >= gap && less(moved, first[to - gap]); to -= gap) first[to] = first[to - gap];
      first[to] = moved;
    }
  }
}
/// The same by `<`.
template <class T>
void sort_plain(T* first, std::size_t n) {
  sort_plain(first, n, [](const T& a, const T& b) { return a < b; });
}

/// Moves elements so that element k < n is the one that sorting would put there; returns it. None is NaN. Quickselect [Hoare,
/// Algorithm 65: find]: O(n) on average, O(n^2) at worst.
template <class T>
[[gnu::noinline]] T select_plain(T* first, std::size_t n, std::size_t k) {
  const auto at = static_cast<std::ptrdiff_t>(k);
  std::ptrdiff_t left = 0, right = static_cast<std::ptrdiff_t>(n) - 1;
  while (left < right) {
    const T pivot = first[at];
    std::ptrdiff_t i = left, j = right;
    do {
      while (first[i] < pivot) ++i;
      while (pivot < first[j]) --j;
      if (i <= j) {
        const T other = first[i];
        first[i++] = first[j];
        first[j--] = other;
      }
    } while (i <= j);
    if (j < at) left = i;
    if (at < i) right = j;
  }
  return first[at];
}

}  // namespace turbomap
