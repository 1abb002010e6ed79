// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Hamming distances against a loop over bits, at every width and alignment; the descriptor concept.

#include <doctest/doctest.h>

#include <random>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/descriptor/descriptor_concept.hpp>
#include <vector>

using namespace turbomap;

namespace {

int bits_that_differ(const std::uint8_t* a, const std::uint8_t* b, int bits) {
  int sum = 0;
  for (int i = 0; i < bits; ++i) sum += ((a[i / 8] ^ b[i / 8]) >> (i % 8)) & 1;
  return sum;
}

/// A user's own metric: the number of bytes that differ.
struct byte_metric {
  using element = std::uint8_t;
  static constexpr int elements = 4;
  static constexpr int bytes = 4;
  using distance_type = int;
  static constexpr int worst = 5;
  static TURBOMAP_HD int distance(const element* a, const element* b) {
    int sum = 0;
    for (int i = 0; i < elements; ++i) sum += a[i] != b[i];
    return sum;
  }
};
struct no_distance {
  using element = std::uint8_t;
  static constexpr int elements = 4;
  static constexpr int bytes = 4;
  using distance_type = int;
  static constexpr int worst = 5;
};
struct wrong_bytes : byte_metric {
  static constexpr int bytes = 3;
};

}  // namespace

TEST_CASE_TEMPLATE("Hamming distance equals a loop over bits", D, binary_descriptor<8>, binary_descriptor<64>,
                   binary_descriptor<72>, binary_descriptor<256>, binary_descriptor<384>, binary_descriptor<488>,
                   binary_descriptor<512>) {
  static_assert(is_descriptor_v<D> && require_descriptor<D>());
  static_assert(D::bytes == D::elements && D::worst > 8 * D::elements);
  std::mt19937 random(4);
  std::vector<std::uint8_t> a(D::elements + 8), b(D::elements + 8);
  for (int i = 0; i < 300; ++i) {
    for (auto& v : a) v = static_cast<std::uint8_t>(random());
    for (auto& v : b) v = static_cast<std::uint8_t>(random());
    const std::uint8_t *p = a.data() + i % 8, *q = b.data() + i / 8 % 8;
    CHECK(D::distance(p, q) == bits_that_differ(p, q, 8 * D::elements));
    CHECK(D::distance(p, q) == D::distance(q, p));
    CHECK(D::distance(p, p) == 0);
    CHECK(D::distance(p, q) <= D::greatest);
    CHECK(D::at_least(p, q) == bits_that_differ(p, q, 8 * ((D::elements + 1) / 2)));
    CHECK(D::at_least(p, q) <= D::distance(p, q));
  }
}

TEST_CASE_TEMPLATE("every bit counts once, and none beyond the end", D, binary_descriptor<256>,
                   binary_descriptor<488>) {
  std::vector<std::uint8_t> zero(D::elements + 8, 0), one(D::elements + 8, 0);
  for (int i = 0; i < 8 * D::elements; ++i) {
    one[i / 8] = static_cast<std::uint8_t>(1 << (i % 8));
    CHECK(D::distance(zero.data(), one.data()) == 1);
    one[i / 8] = 0;
  }
  for (int i = D::elements; i < D::elements + 8; ++i) one[i] = 0xFF;
  CHECK(D::distance(zero.data(), one.data()) == 0);
  std::vector<std::uint8_t> all(D::elements, 0xFF);
  CHECK(D::distance(zero.data(), all.data()) == 8 * D::elements);
}

TEST_CASE("the descriptor concept") {
  static_assert(is_descriptor_v<byte_metric> && require_descriptor<byte_metric>());
  static_assert(!is_descriptor_v<int> && !is_descriptor_v<no_distance> && !is_descriptor_v<wrong_bytes>);
  const std::uint8_t a[4] = {1, 2, 3, 4}, b[4] = {1, 0, 3, 0};
  CHECK(byte_metric::distance(a, b) == 2);
}
