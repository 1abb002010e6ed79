// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Ids of keyframes and their handles.

#include <doctest/doctest.h>

#include <turbomap/mapping/handle_table.hpp>

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

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

}  // namespace
