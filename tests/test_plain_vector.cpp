// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

#include <doctest/doctest.h>

#include <turbomap/plain_vector.hpp>
#include <turbomap/span.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <random>
#include <type_traits>
#include <utility>
#include <vector>

namespace {

using turbomap::plain_vector;

struct odd {  // 12 bytes, and not zero when new
  int a = 7;
  float b = -1;
  std::uint8_t c = 3;
};
bool operator==(const odd& x, const odd& y) { return x.a == y.a && x.b == y.b && x.c == y.c; }

template <class T>
T value(std::mt19937& random) {
  return static_cast<T>(random());
}
template <>
odd value<odd>(std::mt19937& random) {
  return {static_cast<int>(random()), static_cast<float>(random()), static_cast<std::uint8_t>(random())};
}

template <class T>
void check_same(const plain_vector<T>& mine, const std::vector<T>& oracle) {
  REQUIRE(mine.size() == oracle.size());
  CHECK(mine.empty() == oracle.empty());
  CHECK(mine == oracle);
  CHECK(static_cast<std::vector<T>>(mine) == oracle);
  CHECK(mine.capacity() >= mine.size());
  CHECK(mine.end() - mine.begin() == static_cast<std::ptrdiff_t>(oracle.size()));
  if (oracle.empty()) return;
  CHECK(mine.front() == oracle.front());
  CHECK(mine.back() == oracle.back());
  CHECK(mine[oracle.size() / 2] == oracle[oracle.size() / 2]);
}

TEST_CASE_TEMPLATE("random operations: what std::vector does", T, std::uint8_t, double, odd) {
  std::mt19937 random(1);
  plain_vector<T> mine;
  std::vector<T> oracle;
  for (int step = 0; step < 3000; ++step) {
    const std::size_t n = random() % 40;
    const T x = value<T>(random);
    switch (random() % 12) {
      case 0:
        mine.resize(n), oracle.resize(n);
        break;
      case 1:
        mine.resize(n, x), oracle.resize(n, x);
        break;
      case 2:
        mine.assign(n, x), oracle.assign(n, x);
        break;
      case 3:
        mine.clear(), oracle.clear();
        break;
      case 4:
        mine.reserve(n), oracle.reserve(n);
        break;
      case 5:
        if (!oracle.empty()) mine.pop_back(), oracle.pop_back();
        break;
      case 6:
        if (!oracle.empty()) mine.push_back(mine.front()), oracle.push_back(oracle.front());  // an element of its own
        break;
      case 7: {
        std::vector<T> more(n, x);
        mine.append(more.data(), n), oracle.insert(oracle.end(), more.begin(), more.end());
        break;
      }
      case 8: {
        std::vector<T> other(n, x);
        mine.assign(other.data(), other.data() + n), oracle = other;
        break;
      }
      case 9: {
        const plain_vector<T> copy = mine;
        check_same(copy, oracle);
        plain_vector<T> moved = std::move(mine);
        CHECK(mine.empty());
        mine = moved;
        break;
      }
      default:
        mine.push_back(x), oracle.push_back(x);
    }
    check_same(mine, oracle);
  }
}

TEST_CASE("a resize with an element of its own, across growth") {
  plain_vector<odd> list{{1, 2, 3}};
  list.resize(100, list[0]);
  for (const odd& x : list) CHECK(x == odd{1, 2, 3});
  list.assign(1000, list[99]);
  for (const odd& x : list) CHECK(x == odd{1, 2, 3});
}

TEST_CASE("assignment to itself, and of an empty list") {
  plain_vector<int> list{1, 2, 3};
  const plain_vector<int>& same = list;
  list = same;
  CHECK(list == std::vector<int>{1, 2, 3});
  list = plain_vector<int>();
  CHECK(list.empty());
  CHECK(list.begin() == list.end());
  plain_vector<int> other(2);
  other.swap(list);
  CHECK(list == std::vector<int>{0, 0});
  CHECK(other.empty());
}

TEST_CASE("memory is kept, and what does not fit is refused with nothing changed") {
  plain_vector<double> list(64, 1.5);
  const double* const data = list.data();
  list.clear();
  list.resize(64);
  CHECK(list.data() == data);
  CHECK_THROWS_AS(list.reserve(std::numeric_limits<std::size_t>::max() / 4), std::bad_alloc);
  CHECK_THROWS_AS(list.resize(std::numeric_limits<std::size_t>::max() / 4), std::bad_alloc);
  CHECK(list.size() == 64);
  CHECK(list.data() == data);
}

TEST_CASE("names that are no plain data are kept in a std::vector") {
  CHECK(std::is_same_v<turbomap::list_of<int*>, plain_vector<int*>>);
  CHECK(std::is_same_v<turbomap::list_of<std::shared_ptr<int>>, std::vector<std::shared_ptr<int>>>);
  const plain_vector<int> list{4, 5};
  const turbomap::span<const int> view = list;
  CHECK(view.data() == list.data());
  CHECK(view.size() == 2);
}

}  // namespace
