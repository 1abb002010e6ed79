// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Lists of what indices have found, under any policy: as a loop over the indices writes them.

#include <turbomap/found_list.hpp>

#include <cstdint>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace turbomap_test {

struct found_number {
  std::int32_t index;
  std::int32_t number;
};
/// An index has found its number where that is not negative.
struct number_found {
  using entry = found_number;

  const std::int32_t* numbers;

  TURBOMAP_HD bool operator()(int i, entry& e) const {
    if (numbers[i] < 0) return false;
    e = {i, numbers[i]};
    return true;
  }
};

/// Lists of many lengths and shares, one after the other with the same memory: longer and shorter than what was expected.
template <class Policy>
void check_found_lists(const Policy& policy) {
  turbomap::context<Policy> ctx(policy);
  turbomap::found_list<found_number, Policy> list(ctx);
  turbomap::array<std::int32_t, turbomap::memory_of_t<Policy>> resident(ctx.resource());
  std::vector<found_number> found{{1, 2}};
  std::mt19937 random(7);
  for (const int count : {0, 1, 31, 511, 512, 513, 5000, 1024, 60000, 600000, 3})
    for (const double share : {0.0, 0.01, 0.5, 1.0}) {
      CAPTURE(count);
      CAPTURE(share);
      std::vector<std::int32_t> numbers;
      std::vector<found_number> expected;
      for (int i = 0; i < count; ++i) {
        numbers.push_back(
            std::uniform_real_distribution<>(0, 1)(random) < share ? static_cast<std::int32_t>(random() % 1000) : -1);
        if (numbers.back() >= 0) expected.push_back({i, numbers.back()});
      }
      resident.resize_discard(numbers.size() + 1);
      turbomap::copy_in(ctx.policy(), resident.data(), numbers.data(), numbers.size() * sizeof(std::int32_t));
      ctx.synchronize();
      list.read(ctx, count, number_found{resident.data()}, found);
      REQUIRE(found.size() == expected.size());
      bool same = true;
      for (std::size_t i = 0; i < found.size(); ++i)
        same = same && found[i].index == expected[i].index && found[i].number == expected[i].number;
      CHECK(same);
    }
}

}  // namespace turbomap_test
