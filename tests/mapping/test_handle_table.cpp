// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Ids of keyframes and their handles.

#include <doctest/doctest.h>

#include <turbomap/mapping/handle_table.hpp>

#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using handle = turbomap::keyframe_handle;

TEST_CASE("what was added is found, also under the ids 0 and 2^64 - 1") {
  turbomap::handle_table table;
  constexpr std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
  CHECK(table.size() == 0);
  table.add(0, {7, 1});
  table.add(last, {8, 2});
  CHECK(table.size() == 2);
  CHECK(table.at(0) == handle{7, 1});
  CHECK(table.at(last) == handle{8, 2});
  turbomap::keyframe_handle found{};
  CHECK(table.find(last, found));
  CHECK(found == handle{8, 2});
  CHECK(table.contains(0));
  CHECK_FALSE(table.contains(1));
}

TEST_CASE("what is not there leaves the handle alone, or throws") {
  turbomap::handle_table table;
  turbomap::keyframe_handle found{3, 4};
  CHECK_FALSE(table.find(5, found));
  CHECK(found == handle{3, 4});
  try {
    table.at(5);
    FAIL("no exception");
  } catch (const std::invalid_argument& e) {
    CHECK(std::string(e.what()) == "turbomap: keyframe id = 5: is not in the store: insert the keyframe first");
  }
}

TEST_CASE("an id has one handle: a second is refused, and the first stays") {
  turbomap::handle_table table;
  table.add(5, {1, 1});
  CHECK_THROWS_AS(table.add(5, {2, 2}), std::invalid_argument);
  CHECK(table.size() == 1);
  CHECK(table.at(5) == handle{1, 1});
  table.erase(6);  // never was there
  table.erase(5);
  CHECK(table.size() == 0);
  CHECK_THROWS_AS(table.at(5), std::invalid_argument);
  table.add(5, {2, 2});
  CHECK(table.at(5) == handle{2, 2});
}

TEST_CASE("ids that come and go in any order, against a std::map") {
  std::mt19937 random(3);
  turbomap::handle_table table;
  std::map<std::uint64_t, handle> truth;
  for (std::uint32_t step = 1; step <= 400; ++step) {
    const std::uint64_t id = random() % 40;
    if (truth.count(id) != 0)
      table.erase(id), truth.erase(id);
    else
      table.add(id, {step, 1}), truth[id] = {step, 1};
    std::vector<handle> listed, expected;
    table.for_each_handle([&](handle h) { listed.push_back(h); });
    for (const auto& [known, h] : truth) expected.push_back(h);
    REQUIRE(listed == expected);
    for (std::uint64_t any = 0; any < 40; ++any) REQUIRE(table.contains(any) == (truth.count(any) != 0));
  }
}

}  // namespace
