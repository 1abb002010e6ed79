// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// What every camera model promises, for each model and scalar: inverse, derivative, resolution bound, undefined
/// places.

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/double_sphere.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/math/linear.hpp>
#include <vector>

#include "reference/larger_or_nan.hpp"

using namespace turbomap;

namespace {

const image_bounds image{0, 0, 640, 480};
const double nan_value = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();

// Parameters of real lenses' size; each sees the whole image and 16 px around it.
template <class C>
C example();
template <>
pinhole<double> example() {
  return {458.6, 457.3, 320.2, 238.4};
}
template <>
pinhole<float> example() {
  return {458.6F, 457.3F, 320.2F, 238.4F};
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
kannala_brandt<float> example() {
  return {190.9F, 191.4F, 320.2F, 238.4F, 0.0034823F, 0.00071503F, -0.0020532F, 0.00020293F};
}
template <>
double_sphere<double> example() {
  return {190.9, 191.1, 320.2, 238.4, -0.19, 0.58};
}
using any = any_camera<pinhole<float>, kannala_brandt<double>>;
template <>
any example() {
  return example<kannala_brandt<double>>();
}

template <class S>
vec3<double> plain(const vec3<S>& a) {
  return {static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)};
}

/// Largest pixel error of project(unproject(pixel)) and largest |length - 1|, over a grid.
template <class S, class C>
void check_round_trip(const C& camera, double pixel_tolerance, double length_tolerance) {
  double worst = 0, worst_length = 0;
  for (int v = -16; v <= 496; v += 8)
    for (int u = -16; u <= 656; u += 8) {
      vec3<S> ray{};
      vec2<S> pixel{};
      REQUIRE(camera.unproject(vec2<S>{S(u), S(v)}, ray));
      REQUIRE(camera.project(ray, pixel));
      worst = turbomap_test::larger_or_nan(worst, std::abs(static_cast<double>(pixel.x) - u));
      worst = turbomap_test::larger_or_nan(worst, std::abs(static_cast<double>(pixel.y) - v));
      worst_length = turbomap_test::larger_or_nan(worst_length, std::abs(norm(plain(ray)) - 1));
    }
  CHECK(worst < pixel_tolerance);
  CHECK(worst_length < length_tolerance);
}

double angle_between(const vec3<double>& a, const vec3<double>& b) { return std::atan2(norm(cross(a, b)), dot(a, b)); }

#define ALL_MODELS                                                                                       \
  pinhole<double>, pinhole<float>, brown_conrady<double>, kannala_brandt<double>, kannala_brandt<float>, \
      double_sphere<double>, any

}  // namespace

TEST_CASE_TEMPLATE("project(unproject(pixel)) is the pixel, unproject gives unit rays", C, ALL_MODELS) {
  const C camera = example<C>();
  check_round_trip<double>(camera, 1e-9, 1e-14);
  check_round_trip<strict<double>>(camera, 1e-9, 1e-14);
  check_round_trip<float>(camera, 5e-3, 1e-6);
}

TEST_CASE_TEMPLATE("double and strict double agree", C, ALL_MODELS) {
  const C camera = example<C>();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 500; ++i) {
    const vec3<double> p{uniform(random), uniform(random), uniform(random)};
    vec2<double> a{-1, -1};
    vec2<strict<double>> b{-1, -1};
    const bool defined = camera.project(p, a);
    CHECK(defined == camera.project(cast<strict<double>>(p), b));
    CHECK(a.x == doctest::Approx(b.x.value).epsilon(1e-12));
    CHECK(a.y == doctest::Approx(b.y.value).epsilon(1e-12));
    if (!defined) CHECK((a.x == -1 && a.y == -1));  // untouched
  }
}

TEST_CASE_TEMPLATE("the Jacobian against central differences", C, ALL_MODELS) {
  const C camera = example<C>();
  std::mt19937 random(6);
  std::uniform_real_distribution<double> u(-16, 656), v(-16, 496), scale(0.3, 20);
  std::vector<vec3<double>> points{{0, 0, 2}, {1e-9, 0, 1}, {1e-4, -2e-4, 3}};
  for (int i = 0; i < 300; ++i) {
    vec3<double> ray{};
    REQUIRE(camera.unproject(vec2<double>{u(random), v(random)}, ray));
    points.push_back(scale(random) * ray);
  }
  for (const auto& p : points) {
    mat23<double> d{};
    REQUIRE(camera.jacobian(p, d));
    const double h = 1e-5 * norm(p);
    for (int k = 0; k < 3; ++k) {
      vec3<double> forth = p, back = p;
      (k == 0 ? forth.x : k == 1 ? forth.y : forth.z) += h;
      (k == 0 ? back.x : k == 1 ? back.y : back.z) -= h;
      vec2<double> a{}, b{};
      REQUIRE(camera.project(forth, a));
      REQUIRE(camera.project(back, b));
      const double tolerance = 1e-6 * 500 / norm(p);
      CHECK(std::abs(d(0, k) - (a.x - b.x) / (2 * h)) < tolerance);
      CHECK(std::abs(d(1, k) - (a.y - b.y) / (2 * h)) < tolerance);
    }
    mat23<strict<double>> s{};
    REQUIRE(camera.jacobian(cast<strict<double>>(p), s));
    for (int k = 0; k < 6; ++k) CHECK(std::abs(s.m[k].value - d.m[k]) < 1e-9 * 500 / norm(p));
  }
}

TEST_CASE_TEMPLATE("min_pixels_per_radian is a lower bound, and not a useless one", C, ALL_MODELS) {
  const C camera = example<C>();
  const double bound = camera.min_pixels_per_radian(image);
  REQUIRE(bound > 0);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> u(-16, 656), v(-16, 496), turn(0, 6.283), near(0, 3);
  double least = infinity;
  for (int i = 0; i < 40000; ++i) {
    const vec2<double> p{u(random), v(random)};
    const double r = near(random), t = turn(random);
    const vec2<double> q = i % 2 == 0 ? vec2<double>{u(random), v(random)}
                                      : vec2<double>{std::clamp(p.x + r * std::cos(t), -16.0, 656.0),
                                                     std::clamp(p.y + r * std::sin(t), -16.0, 496.0)};
    vec3<double> a{}, b{};
    REQUIRE(camera.unproject(p, a));
    REQUIRE(camera.unproject(q, b));
    const double angle = angle_between(a, b);
    if (angle > 1e-7) least = std::min(least, std::hypot(p.x - q.x, p.y - q.y) / angle);
  }
  CHECK(bound <= least);
  CHECK(bound > 0.5 * least);
}

TEST_CASE_TEMPLATE("where a model is not defined it says so and leaves the result alone", C, ALL_MODELS) {
  const C camera = example<C>();
  vec2<double> pixel{-7, -7};
  vec3<double> ray{-7, -7, -7};
  const vec3<double> undefined[] = {
      {nan_value, 0, 1}, {0, nan_value, 1}, {0, 0, nan_value}, {infinity, 0, 1},
      {0, 0, 0},         {0, 0, -1},        {0, -infinity, 1}, {nan_value, nan_value, nan_value}};
  for (const auto& p : undefined) {
    CAPTURE(p.x);
    CAPTURE(p.y);
    CAPTURE(p.z);
    CHECK_FALSE(camera.project(p, pixel));
    CHECK_FALSE(camera.project(cast<strict<double>>(p), *std::make_unique<vec2<strict<double>>>()));
  }
  for (double bad : {nan_value, infinity, -infinity}) {
    CHECK_FALSE(camera.unproject(vec2<double>{bad, 1}, ray));
    CHECK_FALSE(camera.unproject(vec2<double>{1, bad}, ray));
  }
  CHECK((pixel.x == -7 && pixel.y == -7));
  CHECK((ray.x == -7 && ray.y == -7 && ray.z == -7));
}

TEST_CASE_TEMPLATE("the optical axis meets the principal point", C, ALL_MODELS) {
  const C camera = example<C>();
  vec2<double> centre{};
  REQUIRE(camera.project(vec3<double>{0, 0, 3}, centre));
  CHECK(centre.x == doctest::Approx(320.2).epsilon(1e-6));
  CHECK(centre.y == doctest::Approx(238.4).epsilon(1e-6));
  vec3<double> ray{};
  REQUIRE(camera.unproject(centre, ray));
  CHECK(norm(cross(ray, vec3<double>{0, 0, 1})) < 1e-12);
}

TEST_CASE("pinhole: formula, in front only, rectilinear") {
  const pinhole<double> camera{400, 410, 300, 200};
  vec2<double> pixel{};
  REQUIRE(camera.project(vec3<double>{1, -2, 4}, pixel));
  CHECK(pixel.x == 400.0 / 4 + 300);
  CHECK(pixel.y == -410.0 * 2 / 4 + 200);
  CHECK_FALSE(camera.project(vec3<double>{1, 1, 0}, pixel));
  CHECK_FALSE(camera.project(vec3<double>{1, 1, -1}, pixel));
  mat23<double> d{};
  CHECK_FALSE(camera.jacobian(vec3<double>{1, 1, -1}, d));
  pinhole<double> same{};
  REQUIRE(camera.as_pinhole(same));
  CHECK((same.fx == 400 && same.fy == 410 && same.cx == 300 && same.cy == 200));
  CHECK(camera.min_pixels_per_radian(image) == 400);
  CHECK_FALSE(example<kannala_brandt<double>>().as_pinhole(same));
  CHECK_FALSE(example<brown_conrady<double>>().as_pinhole(same));
  CHECK_FALSE(example<double_sphere<double>>().as_pinhole(same));
}

TEST_CASE("Kannala-Brandt: sideways and behind") {
  const auto camera = example<kannala_brandt<double>>();
  for (double theta : {1.5, 1.5707963267948966, 1.7, 2.0})
    for (double phi : {0.0, 1.0, 3.0}) {
      const vec3<double> p{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
      vec2<double> pixel{};
      vec3<double> ray{};
      REQUIRE(camera.project(p, pixel));
      REQUIRE(camera.unproject(pixel, ray));
      CHECK(norm(ray - p) < 1e-12);
    }
  vec2<double> pixel{};
  CHECK(camera.project(vec3<double>{1, 0, 0}, pixel));  // z = 0
  CHECK_FALSE(camera.project(vec3<double>{0, 0, -1}, pixel));
}

TEST_CASE("Kannala-Brandt: a polynomial that folds back is used up to the fold only") {
  // theta_d = theta - 0.2 theta^3 + 0.02 theta^5 ... rises until about 1.29, falls, and with k4 rises again.
  const kannala_brandt<double> camera{200, 200, 320, 240, -0.2, 0.0, 0.0, 0.0008};
  const detail::radial_polynomial<double> d{-0.2, 0, 0, 0.0008};
  const double fold = std::sqrt(d.first_fold(9.8));
  REQUIRE(fold > 1.0);
  int defined = 0, undefined = 0;
  for (double theta = 0.01; theta < 3.1; theta += 0.01) {
    const vec3<double> p{std::sin(theta), 0, std::cos(theta)};
    vec2<double> pixel{};
    if (!camera.project(p, pixel)) {
      CHECK_FALSE(camera.jacobian(p, *std::make_unique<mat23<double>>()));
      ++undefined;
      continue;
    }
    ++defined;
    vec3<double> ray{};
    REQUIRE(camera.unproject(pixel, ray));
    CHECK(norm(ray - p) < 1e-6);
  }
  CHECK(defined > 100);
  CHECK(undefined > 100);
  vec3<double> ray{};
  CHECK_FALSE(
      camera.unproject(vec2<double>{320 + 200 * 1.2, 240}, ray));  // beyond what any ray reaches before the fold
  CHECK(camera.min_pixels_per_radian(image) == 0);
}

TEST_CASE("Kannala-Brandt: any polynomial, usual or absurd: the least angle, or none") {
  std::mt19937 random(11);
  const auto uniform = [&random](double limit) { return limit * (static_cast<double>(random() % 200001) / 1e5 - 1); };
  int rays = 0, none = 0, unnoticed = 0;
  for (int i = 0; i < 20000; ++i) {
    const double size = i % 3 == 0 ? 0.02 : i % 3 == 1 ? 0.3 : 3;
    const kannala_brandt<double> camera{100, 100, 0, 0, uniform(size), uniform(size), uniform(size), uniform(size)};
    const double theta_d = 1.6 + uniform(1.59);
    // The first sign change of theta_d(theta) - theta_d on a fine grid, as long as it rises.
    const auto d = [&](double t) {
      const double z = t * t;
      return t * (1 + z * (camera.k1 + z * (camera.k2 + z * (camera.k3 + z * camera.k4))));
    };
    double expected = -1, smallest_rise = 1;
    bool folds_near = false;
    constexpr double step = 2e-4;
    for (double t = 0; t < 3.14 && expected < 0; t += step) {
      const double rise = (d(t + step) - d(t)) / step;
      smallest_rise = std::min(smallest_rise, rise);
      if (rise <= 0) {
        folds_near = d(t) > theta_d - 0.01;
        break;
      }
      if (d(t) <= theta_d && d(t + step) > theta_d) expected = t;
    }
    if (folds_near || (expected >= 0 && smallest_rise < 0.02)) continue;  // the grid is too coarse to say
    vec3<double> ray{};
    const bool seen = camera.unproject(vec2<double>{100 * theta_d, 0}, ray);
    if (expected < 0 && !seen) ++none;
    if (expected < 0) {
      unnoticed += seen && std::atan2(ray.x, ray.z) < 3.13 ? 1 : 0;
      continue;
    }
    ++rays;
    REQUIRE(seen);
    CHECK(std::abs(std::atan2(ray.x, ray.z) - expected) < 2 * step);
  }
  CHECK(rays > 3000);
  CHECK(none > 3000);
  CHECK(unnoticed <= 1);  // a fold and unfold between two samples of first_fold(); no lens does that
}

TEST_CASE_TEMPLATE("Kannala-Brandt: every ray that has a pixel comes back", S, double, strict<double>) {
  const auto comes_back = [](const kannala_brandt<double>& camera, double theta) {
    const vec3<double> p{std::sin(theta), 0, std::cos(theta)};
    vec2<S> pixel{};
    vec3<S> ray{};
    if (!camera.project(cast<S>(p), pixel)) return true;
    return camera.unproject(pixel, ray) && norm(plain(ray) - p) < 1e-9;
  };
  // Newton's method goes to and fro between two angles for these.
  CHECK(comes_back({300, 300, 320, 240, 0.0021098, 0.0923170, -0.0048731, -0.0142305}, 1.29952));
  CHECK(comes_back({300, 300, 320, 240, 0.145943, 0.0101074, 0.0211559, -0.0148192}, 1.23176));
  std::mt19937 random(13);
  const auto uniform = [&](double limit) { return std::uniform_real_distribution<double>(-limit, limit)(random); };
  int lost = 0;
  for (int i = 0; i < 1000000; ++i) {
    const kannala_brandt<double> camera{300, 300, 320, 240, uniform(0.2), uniform(0.1), uniform(0.05), uniform(0.02)};
    const detail::radial_polynomial<double> d{camera.k1, camera.k2, camera.k3, camera.k4};
    const double theta = 1.55 + uniform(1.55);
    if (d.slope(theta * theta) > 0.01) lost += comes_back(camera, theta) ? 0 : 1;
  }
  CHECK(lost == 0);
}

TEST_CASE("Brown-Conrady: no ray for a pixel beyond the fold, none behind") {
  const brown_conrady<double> camera{400, 400, 320, 240, -0.3,
                                     0,   0,   0,   0};  // r - 0.3 r^3 rises until r = 1.054, to 0.703
  vec3<double> ray{};
  vec2<double> pixel{};
  CHECK(camera.unproject(vec2<double>{320 + 400 * 0.69, 240}, ray));
  CHECK_FALSE(camera.unproject(vec2<double>{320 + 400 * 0.72, 240}, ray));
  CHECK(camera.project(vec3<double>{1.0, 0, 1}, pixel));
  CHECK_FALSE(camera.project(vec3<double>{1.2, 0, 1}, pixel));
  CHECK_FALSE(camera.project(vec3<double>{0.1, 0, -1}, pixel));
  CHECK(camera.min_pixels_per_radian(image) == 0);
}

TEST_CASE_TEMPLATE("Brown-Conrady: every ray before the fold comes back, however strong the distortion", S, double,
                   strict<double>) {
  // How much less than the ideal image's an area of the image is; <= 0 at and beyond the fold.
  const auto determinant = [](const brown_conrady<double>& camera, double x, double y) {
    mat23<double> d{};
    if (!camera.jacobian(vec3<double>{x, y, 1}, d)) return -1.0;
    return (d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0)) / (camera.fx * camera.fy);
  };
  const auto comes_back = [](const brown_conrady<double>& camera, double x, double y) {
    const vec3<S> p{S(x), S(y), S(1)};
    vec2<S> pixel{};
    vec3<S> ray{};
    return camera.project(p, pixel) && camera.unproject(pixel, ray) &&
           norm(plain(ray) - (1 / norm(plain(p))) * plain(p)) < 1e-9;
  };
  // Defined out to 62 degrees; from 50.6 degrees on the distorted point lies beyond the fold.
  const brown_conrady<double> pincushion{500, 500, 640, 480, 0.5, -0.1, 0, 0, 0};
  for (double degrees = 1; degrees < 62; ++degrees) CHECK(comes_back(pincushion, std::tan(degrees * 0.0174533), 0));
  std::mt19937 random(14);
  const auto uniform = [&](double limit) { return std::uniform_real_distribution<double>(-limit, limit)(random); };
  int rays = 0, lost = 0;
  for (int i = 0; i < 40000; ++i) {
    const brown_conrady<double> camera{500,          480,           320,           240,         uniform(0.5),
                                       uniform(0.5), uniform(0.01), uniform(0.01), uniform(0.3)};
    const double r = std::tan(0.7 + uniform(0.7)), turn = uniform(3.1416), x = r * std::cos(turn),
                 y = r * std::sin(turn);
    bool before_fold = true;
    for (int k = 1; k <= 100 && before_fold; ++k) before_fold = determinant(camera, x * k / 100, y * k / 100) > 0.02;
    if (!before_fold) continue;
    ++rays, lost += comes_back(camera, x, y) ? 0 : 1;
  }
  CHECK(rays > 20000);
  CHECK(lost == 0);
}

TEST_CASE("double sphere: beyond 180 degrees, and the end of the image circle") {
  const auto camera = example<double_sphere<double>>();
  const vec3<double> p{std::sin(1.65), 0, std::cos(1.65)};
  vec2<double> pixel{};
  vec3<double> ray{};
  REQUIRE(camera.project(p, pixel));
  REQUIRE(camera.unproject(pixel, ray));
  CHECK(norm(ray - p) < 1e-12);
  CHECK_FALSE(camera.unproject(vec2<double>{320.2 + 190.9 * 1.01 / std::sqrt(2 * 0.58 - 1), 238.4}, ray));
  // xi = alpha = 0 is the pinhole.
  const double_sphere<double> flat{400, 410, 300, 200, 0, 0};
  REQUIRE(flat.project(vec3<double>{1, -2, 4}, pixel));
  CHECK(pixel.x == 400);
  CHECK(pixel.y == -5);
}

TEST_CASE_TEMPLATE("double sphere: what unproject() gives, project() accepts", S, double, strict<double>) {
  std::mt19937 random(7);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  int rays = 0, no_pixel = 0;
  for (int i = 0; i < 200000; ++i) {
    const double_sphere<double> camera{uniform(100, 600), uniform(100, 600), 320, 240,
                                       uniform(-0.99, 1), uniform(0, 1)};
    const vec2<S> pixel{S(uniform(-200, 840)), S(uniform(-200, 680))};
    vec3<S> ray{};
    vec2<S> again{};
    if (!camera.unproject(pixel, ray)) continue;
    ++rays, no_pixel += camera.project(ray, again) ? 0 : 1;
  }
  CHECK(rays > 100000);
  CHECK(no_pixel == 0);
}

TEST_CASE("validate names the parameter") {
  const auto message = [](const auto& camera) {
    try {
      camera.validate();
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  CHECK(message(example<pinhole<double>>()).empty());
  CHECK(message(example<kannala_brandt<float>>()).empty());
  CHECK(message(example<brown_conrady<double>>()).empty());
  CHECK(message(example<double_sphere<double>>()).empty());
  CHECK(has(message(pinhole<double>{0, 1, 0, 0}), "fx = 0"));
  CHECK(has(message(pinhole<double>{1, -2, 0, 0}), "fy = -2"));
  CHECK(has(message(pinhole<double>{1, nan_value, 0, 0}), "fy"));
  CHECK(has(message(pinhole<double>{1, 1, infinity, 0}), "cx"));
  CHECK(has(message(kannala_brandt<double>{1, 1, 0, 0, 0, 0, nan_value, 0}), "k3"));
  CHECK(has(message(brown_conrady<double>{1, 1, 0, 0, 0, 0, nan_value, 0, 0}), "p1"));
  CHECK(has(message(double_sphere<double>{1, 1, 0, 0, 0, 1.5}), "alpha = 1.5"));
  CHECK(has(message(double_sphere<double>{1, 1, 0, 0, -1, 0.5}), "xi = -1"));
}
