// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Squared Euclidean distances: exact where exactness is promised, the same bits everywhere, close to the truth.

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <turbomap/descriptor/descriptor_concept.hpp>
#include <turbomap/descriptor/real.hpp>
#include <type_traits>
#include <vector>

using namespace turbomap;

namespace {

/// binary16 by its definition.
double half_by_definition(std::uint16_t bits) {
  const int exponent = (bits >> 10) & 31, fraction = bits & 1023;
  const double magnitude = exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024 + fraction, exponent - 25);
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

std::uint32_t float_bits(float a) {
  std::uint32_t b;
  std::memcpy(&b, &a, sizeof b);
  return b;
}

/// The documented order, one operation at a time through volatile: no flag can change it.
template <class Storage>
float in_documented_order(const Storage* a, const Storage* b, int length) {
  volatile float lane[16] = {};
  for (int i = 0; i < length; ++i) {
    volatile float d = detail::as_float(a[i]) - detail::as_float(b[i]);
    lane[i % 16] = std::fma(static_cast<float>(d), static_cast<float>(d), static_cast<float>(lane[i % 16]));
  }
  for (int step : {8, 4, 2, 1})
    for (int l = 0; l < step; ++l) lane[l] = lane[l] + lane[l + step];
  return lane[0];
}

template <class Storage>
Storage random_element(std::mt19937& random);
template <>
float random_element<float>(std::mt19937& random) {
  volatile float v = std::uniform_real_distribution<float>(-1, 1)(random);  // rounded to float, also under -ffast-math
  return v;
}
template <>
turbomap::half random_element<turbomap::half>(std::mt19937& random) {
  return turbomap::half{
      static_cast<std::uint16_t>((random() & 0x8000u) | (random() % 0x4400u))};  // up to 4, subnormals too
}

template <class D>
void check_order() {
  static_assert(is_descriptor_v<D> && require_descriptor<D>());
  std::mt19937 random(9);
  std::vector<typename D::element> a(D::elements), b(D::elements);
  int different = 0;
  for (int i = 0; i < 300; ++i) {
    double exact = 0;
    for (int k = 0; k < D::elements; ++k) {
      a[k] = random_element<typename D::element>(random), b[k] = random_element<typename D::element>(random);
      const double d = static_cast<double>(detail::as_float(a[k])) - static_cast<double>(detail::as_float(b[k]));
      exact += d * d;
    }
    const float distance = D::distance(a.data(), b.data());
    different += float_bits(distance) != float_bits(in_documented_order(a.data(), b.data(), D::elements));
    CHECK(distance == doctest::Approx(exact).epsilon(1e-6));
    CHECK(D::distance(b.data(), a.data()) == distance);
    CHECK(D::distance(a.data(), a.data()) == 0);
  }
  CHECK(different == 0);
}

}  // namespace

TEST_CASE("half to float: all 65536") {
  int wrong = 0, special = 0;
  for (int i = 0; i < 65536; ++i) {
    const turbomap::half h{static_cast<std::uint16_t>(i)};
    const std::uint32_t bits = float_bits(to_float(h));
    const std::uint32_t sign = (i & 0x8000) != 0 ? 0x80000000u : 0u;
    if (((i >> 10) & 31) == 31) {
      ++special;
      wrong += bits != (sign | 0x7F800000u | static_cast<std::uint32_t>(i & 1023) << 13);
    } else {
      wrong += bits != float_bits(static_cast<float>(half_by_definition(h.bits)));
    }
  }
  CHECK(wrong == 0);
  CHECK(special == 2048);
  CHECK(to_float(turbomap::half{0x3C00}) == 1);
  CHECK(to_float(turbomap::half{0xC000}) == -2);
}

TEST_CASE("float: the documented order, to the bit") {
  check_order<real_descriptor<float, 1>>();
  check_order<real_descriptor<float, 15>>();
  check_order<real_descriptor<float, 16>>();
  check_order<real_descriptor<float, 61>>();
  check_order<real_descriptor<float, 64>>();
  check_order<real_descriptor<float, 128>>();
  check_order<real_descriptor<float, 256>>();
  check_order<real_descriptor<float, 300>>();
}

TEST_CASE("half: the documented order, to the bit") {
  check_order<real_descriptor<turbomap::half, 61>>();
  check_order<real_descriptor<turbomap::half, 64>>();
  check_order<real_descriptor<turbomap::half, 128>>();
}

TEST_CASE("8-bit: exact") {
  using D = real_descriptor<std::int8_t, 128>;
  static_assert(is_descriptor_v<D> && std::is_same_v<D::distance_type, std::int32_t>);
  std::mt19937 random(10);
  std::vector<std::int8_t> a(128), b(128);
  for (int i = 0; i < 300; ++i) {
    std::int64_t exact = 0;
    for (int k = 0; k < 128; ++k) {
      a[k] = static_cast<std::int8_t>(random()), b[k] = static_cast<std::int8_t>(random());
      const std::int64_t d = std::int64_t{a[k]} - std::int64_t{b[k]};
      exact += d * d;
    }
    CHECK(D::distance(a.data(), b.data()) == exact);
  }
  using longest = real_descriptor<std::int8_t, 33025>;
  const std::vector<std::int8_t> low(33025, -128), high(33025, 127);
  CHECK(longest::distance(low.data(), high.data()) == 33025 * 65025);
}
