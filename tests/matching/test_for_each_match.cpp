// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Which results are matches, found many at a time: beside a loop, wherever the list begins and ends.

#include <turbomap/matching/search_view.hpp>

#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

TEST_CASE("matches are found in their order, wherever they are") {
  std::mt19937 random(3);
  for (const unsigned rarity : {1U, 2U, 7U, 60U, 100000U}) {
    std::vector<std::int32_t> match(200);
    // 0 and the largest number too: neither may be taken for no_match.
    for (auto& m : match)
      m = random() % rarity != 0 ? turbomap::no_match : random() % 2 == 0 ? 0 : static_cast<std::int32_t>(0x7fffffff);
    for (int begin = 0; begin <= 70; ++begin)
      for (int end = begin; end <= 200; end += 1 + end / 40) {
        std::vector<int> expected, found;
        for (int i = begin; i < end; ++i)
          if (match[static_cast<std::size_t>(i)] != turbomap::no_match) expected.push_back(i);
        turbomap::for_each_match(match.data(), begin, end, [&](int i) { found.push_back(i); });
        REQUIRE(found == expected);
      }
  }
}
