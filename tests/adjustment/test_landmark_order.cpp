// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The order of landmarks against a sort by comparison.

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <turbomap/adjustment/landmark_order.hpp>

namespace {

using indices = std::vector<std::int32_t>;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// \param rows  of each of two groups
void check(turbomap::landmark_order& order, int frames, int landmarks, int rows, bool some_fixed, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> fixed;
  for (int f = 0; some_fixed && f < frames; ++f) fixed.push_back(random() % 3 == 0 ? 1 : 0);
  indices frame[2], landmark[2];
  std::vector<std::pair<int, int>> key(at(landmarks), {frames, 0});
  for (int g = 0; g < 2; ++g)
    for (int r = 0; r < rows; ++r) {
      const int f = static_cast<int>(random() % static_cast<unsigned>(frames));
      const int l = static_cast<int>(random() % static_cast<unsigned>(landmarks));
      frame[g].push_back(f), landmark[g].push_back(l);
      if (some_fixed && fixed[at(f)] != 0) continue;
      auto& [first, last] = key[at(l)];
      first = std::min(first, f), last = std::max(last, f);
    }
  std::vector<turbomap::landmark_group_input> groups;
  for (int g = 0; g < 2; ++g)
    groups.push_back({{frame[g].data(), frame[g].size()}, {landmark[g].data(), landmark[g].size()}, nullptr, 1});
  order.find({frames, landmarks, {fixed.data(), fixed.size()}, {groups.data(), groups.size()}, {}, 8});

  indices source, place(at(landmarks));
  for (int l = 0; l < landmarks; ++l) source.push_back(l);
  std::stable_sort(source.begin(), source.end(), [&](int a, int b) { return key[at(a)] < key[at(b)]; });
  for (int l = 0; l < landmarks; ++l) place[at(source[at(l)])] = l;
  CHECK(indices(order.source().begin(), order.source().end()) == source);
  CHECK(indices(order.place().begin(), order.place().end()) == place);
}

TEST_CASE("landmarks by first and last free frame, equal ones as they came, whatever the problem before") {
  turbomap::landmark_order order;
  unsigned seed = 1;
  for (const bool some_fixed : {false, true})
    for (const auto& [frames, landmarks] : {std::pair{30, 400}, {5, 300}, {1, 9}, {200, 20}})
      for (const int rows : {0, 40, 1500}) check(order, frames, landmarks, rows, some_fixed, seed++);
}

TEST_CASE("no landmarks") {
  turbomap::landmark_order order;
  order.find({3, 0, {}, {}, {}, 8});
  CHECK(order.source().empty());
  CHECK(order.place().empty());
}

}  // namespace
