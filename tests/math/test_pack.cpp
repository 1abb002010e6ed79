// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Packs against plain numbers, rotations against Eigen, dual numbers against known derivatives.

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <turbomap/math/dual.hpp>
#include <turbomap/math/pack_convert.hpp>
#include <turbomap/math/pack_functions.hpp>
#include <turbomap/math/rotation.hpp>

#include "reference/eigen.hpp"

namespace {

using namespace turbomap;

template <class T, int N>
void check_pack() {
  CAPTURE(N);
  std::mt19937 random(1);
  std::uniform_real_distribution<T> uniform(T(0.1), T(3));
  T a[N], b[N], c[N], out[N];
  for (int i = 0; i < N; ++i) a[i] = uniform(random), b[i] = uniform(random), c[i] = -uniform(random);
  using P = pack<T, N>;
  const P x = P::load(a), y = P::load(b), z = P::load(c);
  const auto same = [&](const P& p, auto expected) {
    p.store(out);
    for (int i = 0; i < N; ++i) CHECK(out[i] == doctest::Approx(static_cast<double>(expected(i))).epsilon(1e-6));
  };
  same(x + y, [&](int i) { return a[i] + b[i]; });
  same(x - y, [&](int i) { return a[i] - b[i]; });
  same(x * y, [&](int i) { return a[i] * b[i]; });
  same(x / y, [&](int i) { return a[i] / b[i]; });
  same(-x, [&](int i) { return -a[i]; });
  same(P(T(2)), [&](int) { return T(2); });
  same(multiply_add(x, y, z), [&](int i) { return a[i] * b[i] + c[i]; });
  same(sqrt(x), [&](int i) { return std::sqrt(a[i]); });
  same(larger(x, y), [&](int i) { return a[i] > b[i] ? a[i] : b[i]; });
  same(select_greater(x, y, z, x), [&](int i) { return a[i] > b[i] ? c[i] : a[i]; });
  T total = 0;
  for (int i = 0; i < N; ++i) total += a[i];
  CHECK(sum(x) == doctest::Approx(static_cast<double>(total)).epsilon(1e-6));
  const P nan_lanes = select_greater(P(std::numeric_limits<T>::quiet_NaN()), y, x, z);
  same(nan_lanes, [&](int i) { return c[i]; });
  const std::vector<T> table{0, 10, 20, 30, 40, 50, 60, 70, 80, 90};
  int index[N];
  for (int i = 0; i < N; ++i) index[i] = (7 * i) % 5;
  same(P::gather(table.data(), index, 2), [&](int i) { return table[static_cast<std::size_t>(2 * index[i])]; });
}
TEST_CASE("packs compute lane by lane") {
  check_pack<double, 1>(), check_pack<double, 2>(), check_pack<double, 4>(), check_pack<double, 8>();
  check_pack<float, 1>(), check_pack<float, 4>(), check_pack<float, 8>(), check_pack<float, 16>();
}

template <class T, int K>
void check_scatter() {
  constexpr int stride = K + 2;
  pack<T, 8> columns[K];
  for (int k = 0; k < K; ++k) {
    T lane[8];
    for (int l = 0; l < 8; ++l) lane[l] = static_cast<T>(100 * l + k);
    columns[k] = pack<T, 8>::load(lane);
  }
  const int index[8] = {7, 3, 1, 0, 2, 4, 5, 6};
  for (int count = 0; count <= 8; ++count) {
    std::vector<T> out(8 * stride, T(-1));
    scatter(columns, out.data(), index, stride, count);
    for (int l = 0; l < 8; ++l)
      for (int k = 0; k < stride; ++k)
        CHECK(out[static_cast<std::size_t>(index[l] * stride + k)] ==
              (l < count && k < K ? static_cast<T>(100 * l + k) : T(-1)));
  }
}
TEST_CASE("columns become rows, and nothing beyond them is written") {
  check_scatter<float, 3>(), check_scatter<float, 8>(), check_scatter<float, 9>(), check_scatter<float, 18>();
  check_scatter<double, 3>(), check_scatter<double, 4>(), check_scatter<double, 9>(), check_scatter<double, 18>();
}

template <class T>
void check_polar_angle(double tolerance) {
  for (double z = -4; z <= 4; z += 0.0625) {
    T in[8], out[8];
    for (int l = 0; l < 8; ++l) in[l] = static_cast<T>(l < 7 ? 0.37 * l * l + (l == 1 ? 1e-9 : 0) : std::abs(z));
    const T at = static_cast<T>(z);
    if (z == 0) in[0] = in[7] = T(1);
    polar_angle(pack<T, 8>::load(in), pack<T, 8>(at)).store(out);
    for (int l = 0; l < 8; ++l) {
      const double angle = std::atan2(static_cast<double>(in[l]), z);
      CHECK(std::abs(static_cast<double>(out[l]) - angle) <= tolerance * (angle + 1e-30));
    }
  }
}
TEST_CASE("the angle from the axis, everywhere") {
  check_polar_angle<double>(5e-16);
  check_polar_angle<float>(4e-7);
}

TEST_CASE("the exponential of a motion, small and large") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const double size : {0.0, 1e-9, 1e-5, 0.009, 0.0101, 0.3, 2.0, 3.1}) {
    double step[6];
    for (double& s : step) s = size * uniform(random);
    rigid_transform<double> T;
    T.qx = uniform(random), T.qy = uniform(random), T.qz = uniform(random),
    T.qw = uniform(random);  // not of unit length
    T.tx = uniform(random), T.ty = uniform(random), T.tz = uniform(random);
    const auto result = left_exp(step, T);
    Eigen::Matrix4d W = Eigen::Matrix4d::Zero(), power = Eigen::Matrix4d::Identity(), sum = power;
    W << 0, -step[2], step[1], step[3], step[2], 0, -step[0], step[4], -step[1], step[0], 0, step[5], 0, 0, 0, 0;
    for (int k = 1; k < 40; ++k) power = power * W / k, sum += power;
    Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
    M.topLeftCorner<3, 3>() = Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).normalized().toRotationMatrix();
    M.topRightCorner<3, 1>() << T.tx, T.ty, T.tz;
    M = sum * M;
    const auto got = to_isometry<double>(result);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) CHECK(std::abs(got.R(r, c) - M(r, c)) < 1e-13);
    CHECK(std::abs(got.t.x - M(0, 3)) + std::abs(got.t.y - M(1, 3)) + std::abs(got.t.z - M(2, 3)) < 1e-13);
    CHECK(result.qx * result.qx + result.qy * result.qy + result.qz * result.qz + result.qw * result.qw ==
          doctest::Approx(1).epsilon(1e-15));

    using D = dual<6>;  // its derivative at a step of zero
    D zero[6];
    for (int i = 0; i < 6; ++i) zero[i] = D::variable(0, i);
    const auto moved = to_isometry<D>(left_exp(zero, T));
    const vec3<D> p = moved * vec3<D>{D(0.3), D(-0.2), D(0.7)};
    const vec3<double> q = to_isometry<double>(normalised(T)) * vec3<double>{0.3, -0.2, 0.7};
    const double expected[3][6] = {{0, q.z, -q.y, 1, 0, 0}, {-q.z, 0, q.x, 0, 1, 0}, {q.y, -q.x, 0, 0, 0, 1}};
    for (int i = 0; i < 6; ++i) {
      CHECK(std::abs(p.x.d[i] - expected[0][i]) < 1e-14);
      CHECK(std::abs(p.y.d[i] - expected[1][i]) < 1e-14);
      CHECK(std::abs(p.z.d[i] - expected[2][i]) < 1e-14);
    }
  }
}

TEST_CASE("powers of a dual number that is 0") {
  using D = dual<1>;
  const D zero = D::variable(0, 0);
  CHECK((pow(zero, 0).a == 1 && pow(zero, 0).d[0] == 0));  // the first term of a polynomial
  CHECK((pow(zero, 1).a == 0 && pow(zero, 1).d[0] == 1));
  CHECK((pow(zero, 2).a == 0 && pow(zero, 2).d[0] == 0));
  CHECK(std::isinf(pow(zero, 0.5).d[0]));
}

TEST_CASE("dual numbers: every function against central differences") {
  const auto check = [](auto f, double x) {
    using D = dual<2>;
    const D y = f(D::variable(x, 1));
    const double h = 1e-6, d = (f(x + h) - f(x - h)) / (2 * h);
    CHECK(y.a == doctest::Approx(f(x)));
    CHECK(y.d[0] == 0);
    CHECK(y.d[1] == doctest::Approx(d).epsilon(1e-7));
  };
  using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cos, std::exp, std::log, std::pow, std::sin,
      std::sqrt, std::tan;
  for (const double x : {0.2, 0.45, 0.8}) {
    check([](auto v) { return v * v + v / (v + 2) - 3 * v; }, x);
    check([](auto v) { return -v + 1 / v; }, x);
    check([](auto v) { return sqrt(v); }, x);
    check([](auto v) { return sin(v) * cos(v) + tan(v); }, x);
    check([](auto v) { return exp(v) + log(v); }, x);
    check([](auto v) { return asin(v) * acos(v) + atan(v); }, x);
    check([](auto v) { return atan2(v, 2 - v) + atan2(1 - v, -v); }, x);
    check([](auto v) { return pow(v, 2.5) + abs(v - 5); }, x);
    check(
        [](auto v) {
          auto a = v;
          a += v * v, a -= 2, a *= v, a /= v + 1;
          return a;
        },
        x);
  }
}

}  // namespace
