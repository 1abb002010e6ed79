// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The library's own atan2, sin and cos against long double, at special values, and device against host to the bit.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <turbomap/math/functions.hpp>
#include <vector>

#include "reference/larger_or_nan.hpp"
#include "support/support.hpp"

using turbomap::strict;
using S = strict<double>;
using turbomap_test::larger_or_nan;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double pi = 3.14159265358979323846;

/// Error in units in the last place of the exact value.
double ulps(double ours, long double exact) {
  const double spacing =
      std::nextafter(std::abs(static_cast<double>(exact)), infinity) - std::abs(static_cast<double>(exact));
  return static_cast<double>(std::fabs(static_cast<long double>(ours) - exact) / spacing);
}

/// The bits of a number: NaN and infinity tests that -ffast-math cannot remove.
std::uint64_t bits(double a) {
  std::uint64_t b;
  std::memcpy(&b, &a, sizeof b);
  return b;
}
bool same(double a, double b) { return bits(a) == bits(b); }

/// Every magnitude: mantissa in [1, 2), exponent in [-range, range], any sign.
struct any_magnitude {
  std::mt19937_64 random{7};
  double operator()(int range) {
    const double m = std::uniform_real_distribution<double>(1, 2)(random);
    const int e = std::uniform_int_distribution<int>(-range, range)(random);
    return std::ldexp((random() & 1) != 0 ? m : -m, e);
  }
};

/// All four functions of one pair of numbers, for device against host.
struct outputs {
  double v[4];
};
TURBOMAP_HD outputs evaluate(double y, double x) {
  using turbomap::sin_cos;
  S s, c;
  sin_cos(S(x), s, c);
  return {{atan2(S(y), S(x)).value, atan(S(y)).value, s.value, c.value}};
}

}  // namespace

// -ffast-math spoils the references of these, not what they test: the recorded bits below hold under it too.
#if !defined(__FAST_MATH__)

TEST_CASE("atan2: within 2 ulp for every direction and magnitude") {
  any_magnitude number;
  double worst = 0, worst_float = 0;
  for (int range : {0, 3, 60, 500}) {
    for (int i = 0; i < 20000; ++i) {
      const double y = number(range), x = number(range);
      const long double exact = std::atan2(static_cast<long double>(y), static_cast<long double>(x));
      if (std::fabs(exact) < 1e-300L) continue;
      worst = larger_or_nan(worst, ulps(atan2(S(y), S(x)).value, exact));
      worst = larger_or_nan(worst, ulps(atan(S(y)).value, std::atan(static_cast<long double>(y))));
      if (range > 60) continue;
      const float yf = static_cast<float>(y), xf = static_cast<float>(x);
      const float ours = atan2(strict<float>(yf), strict<float>(xf)).value;
      worst_float = larger_or_nan(worst_float, std::abs(ours / std::atan2(double(yf), double(xf)) - 1));
    }
  }
  CHECK(worst < 2);
  CHECK(worst_float < 1e-7);
}

TEST_CASE("atan2: near the ends of the range of double") {
  const double big = std::numeric_limits<double>::max(), small = std::numeric_limits<double>::min();
  CHECK(std::abs(atan2(S(big), S(big)).value - pi / 4) < 1e-15);
  CHECK(std::abs(atan2(S(big), S(big / 3)).value - std::atan2(3.0, 1.0)) < 1e-15);
  CHECK(std::abs(atan2(S(small), S(3 * small)).value - std::atan2(1.0, 3.0)) < 1e-15);
  CHECK(std::abs(atan2(S(small), S(-big)).value - pi) < 1e-15);
}

TEST_CASE("atan2: zeros, infinities and NaN as std::atan2") {
  const double zero = 0.0, values[] = {zero, -zero, 1, -1, infinity, -infinity};
  for (double y : values)
    for (double x : values) {
      CAPTURE(y);
      CAPTURE(x);
      const double ours = atan2(S(y), S(x)).value, theirs = std::atan2(y, x);
      CHECK(ulps(ours, theirs) <= 1);
      CHECK((bits(ours) >> 63) == (bits(theirs) >> 63));
    }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(turbomap::detail::is_finite(atan2(S(nan), S(1)).value));
  CHECK_FALSE(turbomap::detail::is_finite(atan2(S(1), S(nan)).value));
}

TEST_CASE("sin and cos: within 2 ulp up to 2^20, relative also next to their zeros") {
  double worst = 0, identity = 0;
  std::mt19937_64 random(3);
  for (double range : {1e-8, 0.7, 3.2, 100.0, 1e6})
    for (int i = 0; i < 20000; ++i) {
      const double x = std::uniform_real_distribution<double>(-range, range)(random);
      const double s = sin(S(x)).value, c = cos(S(x)).value;
      worst = larger_or_nan(worst, ulps(s, std::sin(static_cast<long double>(x))));
      worst = larger_or_nan(worst, ulps(c, std::cos(static_cast<long double>(x))));
      identity = larger_or_nan(identity, std::abs(s * s + c * c - 1));
    }
  for (int n = 1; n < 5000; ++n) {
    const double x = n * (pi / 2);
    worst = larger_or_nan(worst, ulps(sin(S(x)).value, std::sin(static_cast<long double>(x))));
    worst = larger_or_nan(worst, ulps(cos(S(x)).value, std::cos(static_cast<long double>(x))));
  }
  CHECK(worst < 2);
  CHECK(identity < 1e-15);
}

#endif

TEST_CASE("sin and cos: special values") {
  CHECK(same(sin(S(0)).value, 0));
  CHECK(same(cos(S(0)).value, 1));
  for (double x : {infinity, -infinity, std::numeric_limits<double>::quiet_NaN(), 1e9}) {
    CHECK_FALSE(turbomap::detail::is_finite(sin(S(x)).value));
    CHECK_FALSE(turbomap::detail::is_finite(cos(S(x)).value));
  }
  CHECK(std::abs(sin(strict<float>(0.5F)).value - std::sin(0.5F)) < 1e-7F);
  CHECK(std::abs(cos(strict<float>(0.5F)).value - std::cos(0.5F)) < 1e-7F);
  double s, c;
  turbomap::sin_cos(0.3, s, c);
  CHECK(s == doctest::Approx(std::sin(0.3)));
  CHECK(c == doctest::Approx(std::cos(0.3)));
}

TEST_CASE("is_finite, is_nan and is_negative look at the bits") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(turbomap::detail::is_finite(std::numeric_limits<double>::max()));
  CHECK(turbomap::detail::is_finite(0.0F));
  CHECK_FALSE(turbomap::detail::is_finite(infinity));
  CHECK_FALSE(turbomap::detail::is_finite(-infinity));
  CHECK_FALSE(turbomap::detail::is_finite(nan));
  CHECK_FALSE(turbomap::detail::is_finite(std::numeric_limits<float>::infinity()));
  CHECK_FALSE(turbomap::detail::is_finite(S(nan)));
  CHECK(turbomap::detail::is_nan(nan));
  CHECK_FALSE(turbomap::detail::is_nan(infinity));
  CHECK(turbomap::detail::is_negative(-0.0));
  CHECK_FALSE(turbomap::detail::is_negative(0.0));
}

TEST_CASE("the same bits as recorded once: no compiler, flag or processor changes them") {
  std::uint64_t hash = 14695981039346656037u;  // FNV-1a over the results' bits
  for (int i = 0; i < 2000; ++i) {
    const S x = S(i - 1000) * S(0.0078125), y = S(i * 7 % 2000 - 999) * S(0.015625);
    for (double v : evaluate(y.value, x.value).v) hash = (hash ^ bits(v)) * 1099511628211u;
  }
  CHECK(hash == 7680040781391795435u);
}

#if TURBOMAP_HAS_CUDA
namespace {
__global__ void evaluate_all(const double* in, outputs* out, int n) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < n) out[i] = evaluate(in[2 * i], in[2 * i + 1]);
}
}  // namespace

TEST_CASE("device and host give the same bits") {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    turbomap_test::skip("no CUDA device");
    return;
  }
  const int n = 100000;
  any_magnitude number;
  std::vector<double> in(2 * n);
  for (double& v : in) v = number(18);
  double* d_in = nullptr;
  outputs* d_out = nullptr;
  REQUIRE(cudaMalloc(&d_in, in.size() * sizeof(double)) == cudaSuccess);
  REQUIRE(cudaMalloc(&d_out, n * sizeof(outputs)) == cudaSuccess);
  cudaMemcpy(d_in, in.data(), in.size() * sizeof(double), cudaMemcpyHostToDevice);
  evaluate_all<<<(n + 255) / 256, 256>>>(d_in, d_out, n);
  std::vector<outputs> out(n);
  REQUIRE(cudaMemcpy(out.data(), d_out, n * sizeof(outputs), cudaMemcpyDeviceToHost) == cudaSuccess);
  int different = 0;
  for (int i = 0; i < n; ++i) {
    const outputs host = evaluate(in[2 * i], in[2 * i + 1]);
    different += std::memcmp(&host, &out[i], sizeof host) != 0;
  }
  CHECK(different == 0);
  cudaFree(d_in);
  cudaFree(d_out);
}
#endif
