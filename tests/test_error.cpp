// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// What messages say.

#include <turbomap/error.hpp>

#include <cstdint>
#include <limits>
#include <string>

#include <doctest/doctest.h>

namespace {

using turbomap::printed;

TEST_CASE("values as messages print them") {
  CHECK(printed(0.1F) == "0.100000001");
  CHECK(printed(0.1) == "0.1");
  CHECK(printed(-2.5e300) == "-2.5e+300");
  CHECK(printed(1e9) == "1e+09");
  CHECK(printed(123456789.0) == "123456789");
  CHECK(printed(std::numeric_limits<double>::infinity()) == "inf");
  CHECK(printed(-7) == "-7");
  CHECK(printed(std::uint8_t{200}) == "200");
  CHECK(printed(std::numeric_limits<std::uint64_t>::max()) == "18446744073709551615");
  CHECK(printed(std::numeric_limits<std::int64_t>::min()) == "-9223372036854775808");
  CHECK(printed(true) == "1");
  CHECK(printed("null") == "null");
  CHECK(printed(std::string("text")) == "text");
}

TEST_CASE("an exception names argument, value and rule") {
  CHECK_THROWS_WITH_AS(turbomap::require(false, "neighbours", 0, "must not be empty"),
                       "turbomap: neighbours = 0: must not be empty", std::invalid_argument);
  CHECK_THROWS_WITH_AS(turbomap::reject(std::string("points[") + "3]", 0.5, "must be 1"),
                       "turbomap: points[3] = 0.5: must be 1", std::invalid_argument);
  CHECK_NOTHROW(turbomap::require(true, "neighbours", 1, "must not be empty"));
  CHECK(std::string(turbomap::out_of_memory("pinned host", 12345678901).what()) ==
        "turbomap: out of pinned host memory: 12345678901 bytes were asked for");
}

}  // namespace
