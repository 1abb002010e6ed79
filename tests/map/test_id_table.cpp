// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// An id_table numbers ids as a std::map does, through growth, collisions and clear().

#include <doctest/doctest.h>

#include <turbomap/map/id_table.hpp>

#include <cstdint>
#include <limits>
#include <map>
#include <random>

namespace {

TEST_CASE("ids are numbered in the order in which they are named") {
  turbomap::id_table table;
  CHECK(table.size() == 0);
  CHECK(table.find(7) == turbomap::id_table::none);
  CHECK(table.place(7) == 0);
  CHECK(table.place(0) == 1);
  CHECK(table.place(std::numeric_limits<std::uint64_t>::max()) == 2);
  CHECK(table.place(7) == 0);
  CHECK(table.size() == 3);
  CHECK(table.find(0) == 1);
  CHECK(table.find(1) == turbomap::id_table::none);
  table.clear();
  CHECK(table.size() == 0);
  CHECK(table.find(7) == turbomap::id_table::none);
  CHECK(table.place(0) == 0);
}

TEST_CASE("ids may be prefetched, of an empty table too") {
  turbomap::id_table table;
  table.prefetch(7);
  table.place(7);
  table.prefetch(7), table.prefetch(8);
  CHECK(table.find(7) == 0);
}

TEST_CASE("random ids against a map") {
  std::mt19937_64 random(2);
  turbomap::id_table table;
  for (int round = 0; round < 60; ++round) {
    table.clear();
    std::map<std::uint64_t, std::size_t> truth;
    // In sequence, in steps that collide in the low bits, and anywhere.
    const std::uint64_t step = round % 3 == 0 ? 1 : round % 3 == 1 ? std::uint64_t{1} << 32 : random() | 1;
    bool same = true;
    for (int i = 0; i < 40 << (round % 6); ++i) {
      const std::uint64_t id = step * (random() % 700);
      const auto expected = truth.insert({id, truth.size()}).first->second;
      same = same && table.place(id) == expected && table.size() == truth.size();
      const std::uint64_t other = step * (random() % 700);
      const auto at = truth.find(other);
      same = same && table.find(other) == (at == truth.end() ? turbomap::id_table::none : at->second);
    }
    CHECK(same);
    for (const auto& [id, place] : truth) same = same && table.find(id) == place;
    CHECK(same);
  }
}

}  // namespace
