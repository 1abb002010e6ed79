// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// An id_numbers knows the numbers of ids as a std::map does, through growth and the dropping of ids that are gone.

#include <doctest/doctest.h>

#include <turbomap/mapping/id_numbers.hpp>

#include <cstdint>
#include <map>
#include <random>

namespace {

using turbomap::id_numbers;

TEST_CASE("an id that was given another number keeps it when the one before is erased") {
  id_numbers numbers;
  CHECK(numbers.find(7) == id_numbers::none);
  numbers.set(7, 1);
  numbers.set(7, 2);
  numbers.erase(7, 1);
  CHECK(numbers.find(7) == 2);
  numbers.erase(7, 2);
  CHECK(numbers.find(7) == id_numbers::none);
  numbers.erase(8, 1);  // nothing
  CHECK(numbers.find(8) == id_numbers::none);
}

TEST_CASE("random numbers against a std::map") {
  std::mt19937 random(3);
  id_numbers numbers;
  std::map<std::uint64_t, std::int32_t> truth;
  const auto id_of = [](std::uint64_t n) { return 0x100000001u * n; };
  const auto is_right = [&](std::uint64_t id) {
    const auto at = truth.find(id);
    return numbers.find(id) == (at == truth.end() ? id_numbers::none : at->second);
  };
  const auto erase = [&](std::uint64_t id, std::int32_t number) {
    numbers.erase(id, number);
    const auto at = truth.find(id);
    if (at != truth.end() && at->second == number) truth.erase(at);
  };
  for (std::uint64_t n = 0; n < 20000; ++n) {  // new ids come and old ones go all the time, so that memory is tidied up
    const std::uint64_t id = id_of(n / 4 + random() % 64);
    const auto number = static_cast<std::int32_t>(random() % 4);
    if (random() % 2 == 0)
      numbers.set(id, number), truth[id] = number;
    else
      erase(id, number);
    for (std::int32_t i = 0; i < 4; ++i) erase(id_of(n / 4), i);
    REQUIRE(is_right(id));
  }
  CHECK(truth.size() > 20);
  for (std::uint64_t n = 0; n < 6000; ++n) REQUIRE(is_right(id_of(n)));
}

}  // namespace
