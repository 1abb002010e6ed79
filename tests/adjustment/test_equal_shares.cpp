// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Shares of equal work: every index once, and no share far above the mean.

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

#include <turbomap/adjustment/equal_shares.hpp>

#include "support/policies.hpp"

namespace {

using turbomap_test::sequential;

struct given_work {
  const long long* before;
  long long operator()(int i) const { return before[i]; }
};

struct count_calls {
  int* calls;
  void operator()(int i) const { ++calls[i]; }
};

/// \param most  work of an index
std::vector<long long> random_work(int n, int most) {
  std::mt19937 random(static_cast<unsigned>(1000 * n + most));
  std::vector<long long> before{0};
  for (int i = 0; i < n; ++i) before.push_back(before.back() + random() % static_cast<unsigned>(most + 1));
  return before;
}

TEST_CASE("each index once under every policy, also where there is no work") {
  for (const int n : {0, 1, 5, 63, 64, 65, 1000})
    for (const int most : {0, 1, 50}) {
      const auto before = random_work(n, most);
      const auto once = std::vector<int>(static_cast<std::size_t>(n), 1);
      const auto check = [&](const auto& policy) {
        std::vector<int> calls(static_cast<std::size_t>(n), 0);
        turbomap::for_each_in_shares(policy, n, given_work{before.data()}, count_calls{calls.data()});
        CHECK(calls == once);
      };
      check(sequential{});
      turbomap_test::for_each_parallel_policy(check);
    }
}

TEST_CASE("no share has more than its part and one index") {
  constexpr int n = 500, shares = 16;
  const auto before = random_work(n, 40);
  for (int share = 0; share < shares; ++share) {
    std::vector<int> calls(n, 0);
    const count_calls f{calls.data()};
    turbomap::equal_shares<given_work, count_calls>{n, shares, {before.data()}, f}(share);
    long long work = 0, largest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      work += calls[i] * (before[i + 1] - before[i]);
      largest = std::max(largest, before[i + 1] - before[i]);
    }
    CHECK(work <= before.back() / shares + 1 + largest);
  }
}

}  // namespace
