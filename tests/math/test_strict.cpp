// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// strict<T> rounds every operation, whatever the flags; this file must also pass under -ffast-math -march=native.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <turbomap/math/strict.hpp>

using turbomap::strict;

namespace {
/// Keeps the optimiser from computing at compile time.
template <class T>
T hidden(T v) {
  volatile T kept = v;
  return kept;
}
}  // namespace

TEST_CASE("a product and a sum are never fused") {
  // (1 + 2^-27)^2 = 1 + 2^-26 + 2^-54: the last term is lost when the product is rounded, kept by a fused multiply-add.
  const double a = hidden(1 + 0x1p-27), c = hidden(-(1 + 0x1p-26));
  REQUIRE(std::fma(a, a, c) == 0x1p-54);
  const strict<double> x(a);
  CHECK((x * x + strict<double>(c)).value == 0);
  CHECK((strict<double>(c) + x * x).value == 0);
  CHECK((x * x - strict<double>(-c)).value == 0);
  CHECK((strict<double>(-c) - x * x).value == 0);
  strict<double> sum(c);
  sum += x * x;
  CHECK(sum.value == 0);

  const float af = hidden(1 + 0x1p-12F), cf = hidden(-(1 + 0x1p-11F));
  REQUIRE(std::fma(af, af, cf) == 0x1p-24F);
  CHECK((strict<float>(af) * strict<float>(af) + strict<float>(cf)).value == 0);
}

TEST_CASE("sums are not reassociated and divisions are not turned into products") {
  const strict<double> big(hidden(1e16)), one(hidden(1.0));
  CHECK(((big + one) - big).value == 0);
  CHECK((one + (big - big)).value == 1);
  // x / y * y differs from x, and x * (1 / y) from x / y, for some x and y: count them against exact rules.
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(1, 2);
  int product_differs = 0;
  for (int i = 0; i < 1000; ++i) {
    const strict<double> x(hidden(uniform(random))), y(hidden(uniform(random)));
    const strict<double> q = x / y;
    product_differs += (strict<double>(1) / y * x != q);
    // Correctly rounded: the remainder is at most half a spacing of q times y. fma gives it exactly.
    const double remainder = std::fma(-q.value, y.value, x.value);
    CHECK(std::abs(remainder) <= y.value * (q.value < 1 ? 0x1p-54 : 0x1p-53));
  }
  CHECK(product_differs > 50);
}

TEST_CASE("square root is correctly rounded") {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(1, 4);
  for (int i = 0; i < 1000; ++i) {
    const double x = hidden(uniform(random)), r = sqrt(strict<double>(x)).value;
    // |x - r^2| <= 2 r (half a spacing) + its square.
    CHECK(std::abs(std::fma(-r, r, x)) <= 2 * r * 0x1p-53 + 0x1p-100);
  }
  CHECK(sqrt(strict<float>(hidden(2.0F))).value == 1.41421354F);
}

TEST_CASE("comparisons, sign and compound assignment") {
  strict<double> a(3), b = 4;
  CHECK(a < b);
  CHECK(a <= b);
  CHECK(b > a);
  CHECK(b >= a);
  CHECK(a != b);
  CHECK(a == strict<double>(3.0F));
  CHECK((-a).value == -3);
  CHECK(abs(-a) == a);
  CHECK(abs(a) == a);
  a -= b;
  CHECK(a.value == -1);
  a *= b;
  CHECK(a.value == -4);
  a /= strict<double>(8);
  CHECK(static_cast<double>(a) == -0.5);
  static_assert(std::is_trivially_copyable_v<strict<double>> && sizeof(strict<double>) == 8);
}
