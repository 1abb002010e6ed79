// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/map/replacement_table.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <utility>

namespace {

TEST_CASE("a replacement is known for two rounds") {
  turbomap::replacement_table<int*> table;
  int a = 0, b = 0;
  table.note(7, &a);
  table.note(8, nullptr);  // erased, not merged
  CHECK(table.find(7) == &a);
  CHECK(table.find(8) == nullptr);
  CHECK(table.find(9) == nullptr);
  table.note(7, &b);
  CHECK(table.find(7) == &b);
  table.next_round();
  CHECK(table.find(7) == &b);
  table.next_round();
  CHECK(table.find(7) == nullptr);
  CHECK(table.empty());
}

TEST_CASE("objects live as long as the table names them") {
  turbomap::replacement_table<std::shared_ptr<int>> table;
  auto object = std::make_shared<int>(3);
  const std::weak_ptr<int> watched = object;
  table.note(1, object);
  object.reset();
  table.next_round();
  CHECK(!watched.expired());
  table.next_round();
  CHECK(watched.expired());
  table.note(2, std::make_shared<int>(4));
  table.clear();
  CHECK(!table.find(2));
}

TEST_CASE("as a table of ids with the round in which they were noted") {
  std::mt19937 random(5);
  turbomap::replacement_table<int> table;
  std::map<std::uint64_t, std::pair<int, int>> truth;  // id -> round, name
  for (int step = 0, round = 0; step < 2000; ++step) {
    const std::uint64_t id = random() % 50;
    if (random() % 20 == 0) {
      table.next_round(), ++round;
    } else if (random() % 2 == 0) {
      const int name = 1 + static_cast<int>(random() % 1000);
      table.note(id, name), truth[id] = {round, name};
    }
    const auto known = truth.find(id);
    const bool kept = known != truth.end() && round - known->second.first <= 1;
    REQUIRE(table.find(id) == (kept ? known->second.second : 0));
  }
}

}  // namespace
