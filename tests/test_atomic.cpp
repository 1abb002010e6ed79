// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Counts and minima do not depend on who comes first.

#include <turbomap/atomic.hpp>
#include <turbomap/parallel.hpp>

#include <algorithm>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>
#include <thrust/execution_policy.h>

#include "support/policies.hpp"

namespace {

constexpr int cells = 7;
constexpr std::uint64_t all_ones = ~std::uint64_t{0};

/// A number that looks random and uses all 64 bits.
std::uint64_t number(int i) {
  std::uint64_t x = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL + 1;
  x ^= x >> 29;
  return x * 0xBF58476D1CE4E5B9ULL;
}

struct contend {
  std::int32_t* counts;
  std::uint64_t* least;
  void operator()(int i) const {
    turbomap::atomic_increment(counts + i % cells);
    turbomap::atomic_min(least + i % cells, number(i));
  }
};

TEST_CASE_TEMPLATE("many at once", Policy, TURBOMAP_TEST_POLICIES) {
  const int n = 700000;
  std::vector<std::int32_t> counts(cells, 5);
  std::vector<std::uint64_t> least(cells, all_ones), expected(cells, all_ones);
  turbomap::for_each_index(Policy{}, n, contend{counts.data(), least.data()});
  for (int i = 0; i < n; ++i)
    expected[static_cast<std::size_t>(i % cells)] = std::min(expected[static_cast<std::size_t>(i % cells)], number(i));
  CHECK(least == expected);
  for (const std::int32_t c : counts) CHECK(c == 5 + n / cells);
}

TEST_CASE("minimum: unsigned, and only if less") {
  std::uint64_t x = all_ones;
  turbomap::atomic_min(&x, all_ones);
  CHECK(x == all_ones);
  turbomap::atomic_min(&x, all_ones >> 1);
  CHECK(x == all_ones >> 1);
  turbomap::atomic_min(&x, std::uint64_t{1} << 63);
  CHECK(x == all_ones >> 1);
  turbomap::atomic_min(&x, 0);
  turbomap::atomic_min(&x, 1);
  CHECK(x == 0);
}

}  // namespace
