// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The lists of an observation_pool are those of a vector of vectors; blocks are used again.

#include <doctest/doctest.h>

#include <turbomap/map/simple_map/observation_pool.hpp>

#include <algorithm>
#include <cstdint>
#include <random>
#include <set>
#include <utility>
#include <vector>

namespace {

using turbomap::observation;
using list = std::vector<std::pair<std::int32_t, std::int32_t>>;

list content(const turbomap::observation_pool& pool, std::size_t i) {
  list all;
  for (const observation& o : pool.of(i)) all.push_back({o.keyframe, o.keypoint});
  return all;
}

TEST_CASE("a list keeps the order of its observations") {
  turbomap::observation_pool pool;
  pool.open(1);
  CHECK(pool.of(0).empty());
  CHECK(pool.of(1).empty());
  pool.prefetch(1);  // no list has memory yet
  for (std::int32_t i = 0; i < 9; ++i) pool.add(1, {i, 10 * i});
  pool.open(0), pool.open(1);  // they are there already
  CHECK(pool.of(1).size() == 9);
  CHECK_FALSE(pool.erase(1, {3, 31}));
  CHECK_FALSE(pool.erase(0, {3, 30}));
  CHECK(pool.erase(1, {3, 30}));
  CHECK(pool.erase(1, {8, 80}));
  CHECK(pool.erase(1, {0, 0}));
  CHECK_FALSE(pool.erase(1, {0, 0}));
  CHECK(content(pool, 1) == list{{1, 10}, {2, 20}, {4, 40}, {5, 50}, {6, 60}, {7, 70}});
  CHECK(pool.of(0).empty());
  pool.close(1), pool.close(0);
  CHECK(pool.of(1).empty());
}

TEST_CASE("reserved room is used without moving the list") {
  turbomap::observation_pool pool;
  pool.open(0), pool.open(1);
  pool.reserve(0, 100);
  const observation* const begin = pool.of(0).data();
  for (std::int32_t i = 0; i < 100; ++i) pool.add(0, {i, i});
  CHECK(pool.of(0).data() == begin);
  CHECK(pool.of(0).size() == 100);
  pool.reserve(0, 28);  // 128 in all
  CHECK(pool.of(0).data() == begin);
}

TEST_CASE("blocks that were given back are used again, whatever their size") {
  turbomap::observation_pool pool;
  constexpr std::size_t lists = 50;
  pool.open(lists - 1);
  std::set<const observation*> blocks;
  const auto fill = [&pool](std::size_t size) {
    for (std::size_t i = 0; i < lists; ++i)
      for (std::size_t j = 0; j < size; ++j) pool.add(i, {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)});
  };
  const auto close = [&pool]() {
    for (std::size_t i = 0; i < lists; ++i) pool.close(i);
  };
  fill(33), close();  // blocks of 4, 8, 16, 32, 64 were made
  fill(33);
  for (std::size_t i = 0; i < lists; ++i) blocks.insert(pool.of(i).data());
  for (int round = 0; round < 3; ++round) {
    close(), fill(33);
    for (std::size_t i = 0; i < lists; ++i) {
      CHECK(blocks.count(pool.of(i).data()) == 1);
      CHECK(pool.of(i).size() == 33);
      CHECK(pool.of(i)[32].keyframe == static_cast<std::int32_t>(i));
    }
  }
  CHECK(blocks.size() == lists);
}

TEST_CASE("random lists against vectors") {
  std::mt19937 random(4);
  turbomap::observation_pool pool;
  std::vector<list> truth(40);
  pool.open(truth.size() - 1);
  bool same = true;
  for (int step = 0; step < 60000; ++step) {
    const std::size_t i = random() % truth.size();
    const auto kind = random() % 100;
    if (kind < 62) {
      const observation o{static_cast<std::int32_t>(random() % 50), static_cast<std::int32_t>(random() % 3)};
      pool.add(i, o), truth[i].push_back({o.keyframe, o.keypoint});
    } else if (kind < 97) {
      const std::pair o(static_cast<std::int32_t>(random() % 50), static_cast<std::int32_t>(random() % 3));
      const auto at = std::find(truth[i].begin(), truth[i].end(), o);
      same = same && pool.erase(i, {o.first, o.second}) == (at != truth[i].end());
      if (at != truth[i].end()) truth[i].erase(at);
    } else if (kind < 99) {
      pool.close(i), truth[i].clear();
    } else {
      pool.reserve(i, random() % 40);
    }
    same = same && content(pool, i) == truth[i];
  }
  CHECK(same);
  for (std::size_t i = 0; i < truth.size(); ++i) CHECK(content(pool, i) == truth[i]);
}

}  // namespace
