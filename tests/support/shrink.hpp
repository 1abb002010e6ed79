// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Finds a short failing list inside a long one [Zeller and Hildebrandt, Simplifying and isolating failure-inducing
/// input].

#include <algorithm>
#include <cstddef>
#include <vector>

namespace turbomap_test {

/// Takes chunks away as long as fails(list) stays true: halves, quarters, ... single elements, until no single element
/// can go. The list must fail. O(n log n) runs, mostly of ever shorter lists.
template <class T, class Fails>
std::vector<T> shrink(std::vector<T> list, Fails fails) {
  std::size_t chunk = std::max<std::size_t>(list.size() / 2, 1);
  for (;;) {
    bool shorter = false;
    for (std::size_t begin = 0; begin < list.size();) {
      std::vector<T> rest(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(begin));
      rest.insert(rest.end(), list.begin() + static_cast<std::ptrdiff_t>(std::min(begin + chunk, list.size())),
                  list.end());
      if (fails(rest)) {
        list.swap(rest);
        shorter = true;
      } else {
        begin += chunk;
      }
    }
    if (chunk == 1 && !shorter) return list;
    if (chunk > 1) chunk = (chunk + 1) / 2;
  }
}

/// Makes the numbers of each element as small as it goes, where below 32: `fields(element)` gives pointers to them.
template <class T, class Fields, class Fails>
void shrink_values(std::vector<T>& list, Fields fields, Fails fails) {
  for (std::size_t i = 0; i < list.size(); ++i)
    for (std::size_t f = 0; f < fields(list[i]).size(); ++f)
      for (unsigned value = 0; value < 32; ++value) {
        auto& field = *fields(list[i])[f];
        if (field <= value) break;
        const auto old = field;
        field = value;
        if (fails(list)) break;
        field = old;
      }
}

}  // namespace turbomap_test
