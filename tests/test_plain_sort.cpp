// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/plain_sort.hpp>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <random>
#include <vector>

namespace {

/// Lists of n elements: random ones with and without repetitions, and those that methods of sorting stumble on.
std::vector<std::vector<int>> lists_of(std::size_t n) {
  std::mt19937 random(static_cast<unsigned>(n));
  std::vector<std::vector<int>> lists(6, std::vector<int>(n));
  for (std::size_t i = 0; i < n; ++i) {
    const int ascending = static_cast<int>(i);
    lists[0][i] = static_cast<int>(random() % 1000000) - 500000;
    lists[1][i] = static_cast<int>(random() % 4);
    lists[2][i] = ascending;
    lists[3][i] = -ascending;
    lists[4][i] = 7;
    lists[5][i] = i < n / 2 ? ascending : static_cast<int>(n - i);
  }
  return lists;
}
const std::size_t sizes[] = {0, 1, 2, 3, 4, 5, 12, 13, 14, 40, 41, 121, 1000, 5000};

TEST_CASE("sort_plain sorts as std::sort") {
  for (const std::size_t n : sizes) {
    for (const auto& list : lists_of(n)) {
      auto expected = list, sorted = list;
      std::sort(expected.begin(), expected.end());
      turbomap::sort_plain(sorted.data(), n);
      CHECK(sorted == expected);
      std::sort(expected.begin(), expected.end(), std::greater<int>{});
      turbomap::sort_plain(sorted.data(), n, std::greater<int>{});
      CHECK(sorted == expected);
    }
  }
}

TEST_CASE("select_plain finds the element that sorting puts there") {
  for (const std::size_t n : sizes) {
    for (const auto& list : lists_of(n)) {
      const std::vector<double> numbers(list.begin(), list.end());
      auto sorted = numbers;
      std::sort(sorted.begin(), sorted.end());
      for (const std::size_t k : {std::size_t{0}, n / 3, (n > 0 ? n - 1 : 0) / 2, n > 0 ? n - 1 : 0}) {
        if (k >= n) continue;
        auto selected = numbers;
        CHECK(turbomap::select_plain(selected.data(), n, k) == sorted[k]);
        CHECK(selected[k] == sorted[k]);
        std::sort(selected.begin(), selected.end());
        CHECK(selected == sorted);  // none was lost
      }
    }
  }
}

}  // namespace
