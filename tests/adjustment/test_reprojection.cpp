// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Residuals and derivatives of reprojections, for every camera model: packs against the camera's own projection and
// against central differences; a whole chunk against sums of one observation each.

#include <doctest/doctest.h>

#include <cmath>
#include <random>
#include <vector>

#include <turbomap/adjustment/reprojection.hpp>
#include <turbomap/adjustment/robust.hpp>
#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/double_sphere.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/math/rotation.hpp>

namespace {

using namespace turbomap;

/// A model without a derivative of its own: u = f x / (z + |p|), and so v.
struct own_camera {
  using scalar = double;
  double f = 300;
  template <class S>
  bool project(const vec3<S>& p, vec2<S>& pixel) const {
    using std::sqrt;
    const S d = p.z + sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
    if (!(d > S(0))) return false;
    pixel.x = S(f) * p.x / d, pixel.y = S(f) * p.y / d;
    return true;
  }
  template <class S>
  bool unproject(const vec2<S>&, vec3<S>&) const {
    return false;
  }
};

template <class C>
C example();
template <>
pinhole<double> example() {
  return {458.6, 457.3, 320.2, 238.4};
}
template <>
brown_conrady<double> example() {
  return {458.6, 457.3, 320.2, 238.4, -0.283, 0.0739, 0.00019, 0.0000176, -0.002};
}
template <>
kannala_brandt<double> example() {
  return {190.9, 191.4, 320.2, 238.4, 0.0034823, 0.00071503, -0.0020532, 0.00020293};
}
template <>
double_sphere<double> example() {
  return {190.9, 191.1, 320.2, 238.4, -0.19, 0.58};
}
using any = any_camera<pinhole<double>, own_camera>;
template <>
own_camera example() {
  return {};
}
template <>
any example() {
  return own_camera{};
}

constexpr int N = 8;
template <class G>
vec3<pack<G, N>> load(const std::vector<vec3<double>>& p) {
  G x[3][N];
  for (std::size_t l = 0; l < N; ++l)
    x[0][l] = static_cast<G>(p[l].x), x[1][l] = static_cast<G>(p[l].y), x[2][l] = static_cast<G>(p[l].z);
  return {pack<G, N>::load(x[0]), pack<G, N>::load(x[1]), pack<G, N>::load(x[2])};
}
template <class T>
std::vector<double> lanes(const pack<T, N>& p) {
  T x[N];
  p.store(x);
  return std::vector<double>(x, x + N);
}

#define ALL_MODELS \
  pinhole<double>, brown_conrady<double>, kannala_brandt<double>, double_sphere<double>, own_camera, any

TEST_CASE_TEMPLATE("residuals and derivatives of every model", C, ALL_MODELS) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const bool mounted : {false, true})
    for (int round = 0; round < 50; ++round) {
      double turn[6];
      for (double& t : turn) t = mounted ? 0.2 * uniform(random) : 0;
      const rig_camera<C> on_rig{
          example<C>(), mounted ? left_exp(turn, rigid_transform<double>{}) : rigid_transform<double>{}, 47.9, {}};
      const adjustment_camera<C> camera(on_rig);
      CHECK(camera.is_body == !mounted);
      const isometry<double> T = to_isometry<double>(on_rig.T_camera_body);
      std::vector<vec3<double>> points, measured;
      for (int l = 0; l < N; ++l) {
        points.push_back({0.8 * uniform(random), 0.8 * uniform(random), 2.5 + uniform(random)});
        measured.push_back({300 + 50 * uniform(random), 200 + 50 * uniform(random), 280 + 50 * uniform(random)});
      }
      const auto expected = [&](vec3<double> X, std::size_t l, int k) {
        const vec3<double> p = T * X;
        vec2<double> q{};
        REQUIRE(on_rig.camera.project(p, q));
        return k == 0 ? q.x - measured[l].x : k == 1 ? q.y - measured[l].y : q.x - 47.9 / p.z - measured[l].z;
      };
      lane_reprojection<double, double, N> r;
      r.template compute<true, true>(camera, load<double>(points), load<double>(measured));
      lane_reprojection<double, float, N> mixed;
      mixed.template compute<true, true>(camera, load<double>(points), load<double>(measured));
      lane_reprojection<float, float, N> single;
      single.template compute<true, true>(camera, load<float>(points), load<float>(measured));
      for (std::size_t l = 0; l < N; ++l)
        for (int k = 0; k < 3; ++k) {
          const double e = expected(points[l], l, k);
          CHECK(lanes(r.defined)[l] == 1);
          CHECK(lanes(r.e[k])[l] == doctest::Approx(e).epsilon(1e-11));
          CHECK(lanes(mixed.e[k])[l] == doctest::Approx(e).epsilon(1e-11));
          CHECK(std::abs(lanes(single.e[k])[l] - e) < 1e-3);
          for (int i = 0; i < 3; ++i) {
            const double h = 1e-6;
            vec3<double> up = points[l], down = points[l];
            (i == 0 ? up.x : i == 1 ? up.y : up.z) += h, (i == 0 ? down.x : i == 1 ? down.y : down.z) -= h;
            const double d = (expected(up, l, k) - expected(down, l, k)) / (2 * h);
            CHECK(std::abs(lanes(r.d[k][i])[l] - d) < 1e-5);
            CHECK(std::abs(lanes(mixed.d[k][i])[l] - d) < 1e-3);
            CHECK(std::abs(lanes(single.d[k][i])[l] - d) < 1e-2);
          }
        }
    }
}

TEST_CASE("where a projection is not defined: no number that is not finite") {
  const std::vector<vec3<double>> points{{1, 1, 0}, {0, 0, 0}, {1, 0, 1e-9},  {1, 1, -2},
                                         {0, 0, 3}, {1, 2, 3}, {-1, 0, -0.0}, {0, 0, -1}};
  const std::vector<vec3<double>> measured(8, {300, 200, 250});
  const auto check = [&](const auto& camera, std::vector<double> defined) {
    lane_reprojection<double, float, N> r;
    r.template compute<true, true>(adjustment_camera<std::decay_t<decltype(camera)>>({camera, {}, 40, {}}),
                                   load<double>(points), load<double>(measured));
    CHECK(lanes(r.defined) == defined);
    for (int k = 0; k < 3; ++k)
      for (const double e : lanes(r.e[k])) CHECK(detail::is_finite(e));
    for (auto& row : r.d)
      for (auto& d : row)
        for (const double x : lanes(d)) CHECK(detail::is_finite(x));
  };
  check(example<pinhole<double>>(), {0, 0, 0, 1, 1, 1, 0, 1});         // behind the camera the formula goes on
  check(example<kannala_brandt<double>>(), {0, 0, 1, 1, 1, 1, 0, 0});  // no disparity where z = 0
  check(example<brown_conrady<double>>(), {0, 0, 0, 0, 1, 1, 0, 0});
}

/// Its derivative on the axis is 0 / 0.
struct kinked_camera {
  using scalar = double;
  template <class S>
  bool project(const vec3<S>& p, vec2<S>& pixel) const {
    using std::atan2;
    using std::sqrt;
    const S r = sqrt(p.x * p.x + p.y * p.y), scale = r > S(0) ? atan2(r, p.z) / r : S(1) / p.z + S(0) * r;
    pixel.x = S(300) * scale * p.x, pixel.y = S(300) * scale * p.y;
    return p.z > S(0);
  }
  template <class S>
  bool unproject(const vec2<S>&, vec3<S>&) const {
    return false;
  }
};

TEST_CASE("where a derivative is not finite: the row of a pass without derivatives, and zeros for derivatives") {
  const std::vector<vec3<double>> points{{1, 1, 2}, {0, 0, 3}, {1, 0, 4},  {0, 0, 1},
                                         {2, 1, 5}, {1, 2, 3}, {0, 0, -1}, {0, 1, 2}};
  const std::vector<vec3<double>> measured(8, {30, 20, 10});
  const adjustment_camera<kinked_camera> camera({kinked_camera{}, {}, 40, {}}, 0.5);
  lane_reprojection<double, double, N> with, without;
  with.template compute<true, true>(camera, load<double>(points), load<double>(measured));
  without.template compute<false, true>(camera, load<double>(points), load<double>(measured));
  CHECK(lanes(with.defined) == std::vector<double>{1, 1, 1, 1, 1, 1, 0, 1});
  CHECK(lanes(without.defined) == lanes(with.defined));
  for (int k = 0; k < 3; ++k) {
    CHECK(lanes(with.e[k]) == lanes(without.e[k]));
    for (std::size_t l = 0; l < N; ++l) {
      double square = 0;
      for (int i = 0; i < 3; ++i) square += lanes(with.d[k][i])[l] * lanes(with.d[k][i])[l];
      if (points[l].x == 0 && points[l].y == 0)
        CHECK(square == 0);
      else
        CHECK(square > 0);
    }
  }
}

/// chi2 in other places of a pack, on either side of delta^2.
TEST_CASE("kernels: packs as one by one, derivative of rho, values known") {
  const auto check = [](const auto& kernel) {
    for (double s = 0.01; s < 100; s *= 1.3) {
      double rho, weight, up, down, unused;
      kernel(s, rho, weight), kernel(s + 1e-6, up, unused), kernel(s - 1e-6, down, unused);
      CHECK(weight == doctest::Approx((up - down) / 2e-6).epsilon(1e-4));
      CHECK(rho <= s * (1 + 1e-12));
      pack<double, N> r, w;
      double in[N];
      for (int l = 0; l < N; ++l) in[l] = s * (1 + l);
      apply_kernel(kernel, pack<double, N>::load(in), r, w);
      for (std::size_t l = 0; l < N; ++l) {
        kernel(in[l], rho, weight);
        CHECK(lanes(r)[l] == doctest::Approx(rho).epsilon(1e-14));
        CHECK(lanes(w)[l] == doctest::Approx(weight).epsilon(1e-14));
      }
    }
    double rho, weight;
    kernel(0.0, rho, weight);
    CHECK(rho == doctest::Approx(0));
    CHECK(weight == 1);
  };
  check(no_kernel{});
  check(huber{4});
  check(cauchy{4});
  check(tukey{9});
  double rho, weight;
  huber{4}(9.0, rho, weight);
  CHECK(rho == doctest::Approx(2 * 2 * 3 - 4));
  CHECK(weight == doctest::Approx(2.0 / 3));
  tukey{9}(10.0, rho, weight);
  CHECK(weight == 0);
  CHECK(rho == 3);
}

}  // namespace
