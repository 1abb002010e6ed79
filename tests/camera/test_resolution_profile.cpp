// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The measured resolution is a lower bound for pairs of nearby pixels, and not a needlessly low one.

#include <turbomap/camera/measure_resolution.hpp>

#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include "scenes/matching_rigs.hpp"

namespace {

using namespace turbomap_test;
using turbomap::resolution_profile;

/// Angle between unit rays, exact for small ones too.
double angle_between(const turbomap::vec3<double>& a, const turbomap::vec3<double>& b) {
  const double x = a.y * b.z - a.z * b.y, y = a.z * b.x - a.x * b.z, z = a.x * b.y - a.y * b.x;
  return std::atan2(std::sqrt(x * x + y * y + z * z), a.x * b.x + a.y * b.y + a.z * b.z);
}

struct measured {
  int violations = 0, pairs = 0;
  double tightest = 1e9;  ///< least |pixel difference| / (bound * angle)
  bool varies = false;    ///< somewhere the bound is above the whole image's
};

template <class Camera>
measured measure(const Camera& camera, const turbomap::image_bounds& bounds) {
  const resolution_profile profile = turbomap::measure_resolution(camera, bounds);
  REQUIRE(profile.known());
  const double least = turbomap::min_pixels_per_radian(camera, bounds);
  measured m;
  for (const float p : profile.pixels_per_radian) {
    CHECK(p >= static_cast<float>(least));
    m.varies = m.varies || p > 1.02 * least;
  }
  std::mt19937 random(5);
  std::uniform_real_distribution<double> x(bounds.min_x, bounds.max_x), y(bounds.min_y, bounds.max_y),
      turn(0, 6.2831853);
  for (int i = 0; i < 40000; ++i) {
    const double reach = std::pow(10, std::uniform_real_distribution<double>(-2, std::log10(16.0))(random)),
                 phi = turn(random);
    const turbomap::vec2<double> a{x(random), y(random)}, b{a.x + reach * std::cos(phi), a.y + reach * std::sin(phi)};
    if (b.x < bounds.min_x || b.x > bounds.max_x || b.y < bounds.min_y || b.y > bounds.max_y) continue;
    turbomap::vec3<double> r{}, s{};
    REQUIRE(camera.unproject(a, r));
    REQUIRE(camera.unproject(b, s));
    const double angle = angle_between(r, s);
    for (const double cosine : {r.z, s.z}) {
      const double bound = profile.at(static_cast<float>(cosine));
      m.violations += reach >= bound * angle ? 0 : 1;
      m.tightest = std::min(m.tightest, reach / (bound * angle));
      ++m.pairs;
    }
  }
  return m;
}

template <class Camera>
void check(const Camera& camera, const turbomap::image_bounds& bounds, bool varies) {
  const measured m = measure(camera, bounds);
  CHECK(m.violations == 0);
  CHECK(m.pairs > 60000);
  CHECK(m.tightest < 1.35);
  CHECK(m.varies == varies);
}

TEST_CASE("a pinhole spends the more the farther out") {
  check(turbomap::pinhole<float>{458, 457, 367, 248}, {0, 0, 752, 480}, true);
  check(turbomap::pinhole<double>{300, 600, 320, 240}, {0, 0, 640, 480}, true);   // pixels are not square
  check(turbomap::pinhole<double>{300, 300, -200, 900}, {0, 0, 640, 480}, true);  // cut out of a larger image
  check(turbomap::pinhole<double>{5000, 5000, 320, 240}, {0, 0, 640, 480}, false);
}
TEST_CASE("Kannala-Brandt") {
  for (const float bend : {0.0F, 0.5F, 1.0F}) check(fisheye(bend), {0, 0, 512, 512}, bend > 0);
  using kb = turbomap::kannala_brandt<double>;
  const turbomap::image_bounds image{0, 0, 640, 480};
  check(kb{250, 251, 320, 240, -0.02, 0.001, 0, 0}, image, true);
  check(kb{250, 251, 320, 240, 0.1, -0.02, 0.003, 0}, image, true);
  check(kb{250, 400, 320, 240, -0.01, 0.002, -0.0005, 0}, image, true);
  check(kb{300, 300, 150, 350, -0.01, 0, 0, 0}, image, true);
  check(turbomap::any_camera<turbomap::pinhole<float>, turbomap::kannala_brandt<float>>(fisheye()), {0, 0, 512, 512},
        true);
}
TEST_CASE("double sphere") {
  check(turbomap::double_sphere<double>{190, 190, 254, 256, -0.18, 0.59}, {0, 0, 512, 512}, true);
  check(turbomap::double_sphere<double>{300, 310, 330, 230, 0.2, 0.4}, {0, 0, 640, 480}, true);
}
TEST_CASE("Brown-Conrady") {
  turbomap::brown_conrady<double> c{458, 457, 367, 248};
  c.k1 = -0.28, c.k2 = 0.074, c.p1 = 0.0002, c.p2 = 1.8e-5;
  check(c, {0, 0, 752, 480}, true);
  CHECK(measure(c, {0, 0, 72, 76}).violations == 0);  // a corner of the image: few directions around the axis meet it
  c.k1 = 0.2, c.k2 = -0.05, c.p1 = 0.01, c.p2 = -0.008;
  check(c, {0, 0, 752, 480}, true);
}

/// Pixels per radian at a pixel, in the direction where they are fewest: by differences, without the model's derivative. Negative:
/// it has no ray. \param cosine  of the angle between its ray and the optical axis
template <class Camera>
double resolution_at(const Camera& camera, const turbomap::vec2<double>& pixel, double& cosine) {
  constexpr double step = 1e-3;  // px
  const turbomap::vec2<double> steps[2] = {{step, 0}, {0, step}};
  turbomap::vec3<double> r{}, slope[2];
  if (!camera.unproject(pixel, r)) return -1;
  cosine = r.z;
  for (int i = 0; i < 2; ++i) {
    turbomap::vec3<double> a{}, b{};
    if (!camera.unproject(turbomap::vec2<double>{pixel.x + steps[i].x, pixel.y + steps[i].y}, a) ||
        !camera.unproject(turbomap::vec2<double>{pixel.x - steps[i].x, pixel.y - steps[i].y}, b))
      return -1;
    slope[i] = {(a.x - b.x) / (2 * step), (a.y - b.y) / (2 * step), (a.z - b.z) / (2 * step)};
  }
  const auto dot = [](const auto& a, const auto& b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  const double p = dot(slope[0], slope[0]), q = dot(slope[0], slope[1]), s = dot(slope[1], slope[1]);
  return 1 / std::sqrt((p + s + std::hypot(p - s, 2 * q)) / 2);
}

TEST_CASE("a lower bound everywhere, for lenses of any distortion, also where the image folds just beyond its border") {
  std::mt19937 random(3);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  int pixels = 0, above = 0, above_least = 0;
  const auto count = [&](const auto& camera, const turbomap::image_bounds& image) {
    const resolution_profile profile = turbomap::measure_resolution(camera, image);
    if (!profile.known()) return;
    const double least = turbomap::min_pixels_per_radian(camera, image);
    for (int i = 0; i < 400; ++i) {
      turbomap::vec2<double> pixel{uniform(image.min_x, image.max_x), uniform(image.min_y, image.max_y)};
      if (i % 4 == 0) pixel.x = i % 8 == 0 ? image.min_x : image.max_x;
      if (i % 4 == 1) pixel.y = i % 8 == 1 ? image.min_y : image.max_y;
      double cosine = 1;
      const double here = resolution_at(camera, pixel, cosine) * (1 + 1e-6);
      if (here < 0) continue;
      ++pixels, above += profile.at(static_cast<float>(cosine)) > here ? 1 : 0, above_least += least > here ? 1 : 0;
    }
  };
  for (int i = 0; i < 500; ++i) {
    const double w = uniform(300, 900), h = uniform(300, 900), f = uniform(150, 400), g = f * uniform(0.9, 1.1);
    const double x = w / 2 + uniform(-60, 60), y = h / 2 + uniform(-60, 60);
    const turbomap::image_bounds image{0, 0, static_cast<float>(w), static_cast<float>(h)};
    turbomap::kannala_brandt<double> fish{
        f, g, x, y, uniform(-0.1, 0.1), uniform(-0.05, 0.05), uniform(-0.02, 0.02), uniform(-0.004, 0.004)};
    count(fish, image);
    fish.cx += uniform(-500, 500);  // a small image beside the axis
    count(fish, {0, 0, image.max_x * 0.3F, image.max_y * 0.3F});
    count(turbomap::double_sphere<double>{f, g, x, y, uniform(-0.3, 0.9), uniform(0.3, 0.8)}, image);
    for (const double k : {0.3, 0.6})  // most fold within the image, and have no bound
      count(turbomap::brown_conrady<double>{1.6 * f, 1.6 * g, x, y, uniform(-k, k), uniform(-k / 2, k / 2),
                                            uniform(-0.005, 0.005), uniform(-0.005, 0.005), uniform(-0.05, 0.05)},
            image);
  }
  CHECK(pixels > 200000);
  CHECK(above == 0);
  CHECK(above_least == 0);
}

TEST_CASE("the least resolution of an image that ends just before the fold") {
  // Between two samples of a grid it falls far below both.
  const turbomap::brown_conrady<double> lens{492, 492, 532, 557, 0.1196, -0.0685, -0.0061, -0.009, 0.0071};
  const turbomap::image_bounds image{0, 0, 1064, 1114};
  const double bound = lens.min_pixels_per_radian(image);
  double least = 1e9, cosine = 0;
  for (double u = -16; u <= 1080; u += 0.25)
    for (const double v : {-15.9, 1129.9}) {
      const double here = resolution_at(lens, {u, v}, cosine);
      if (here > 0) least = std::min(least, here);
    }
  CHECK(least < 60);
  CHECK(bound <= least);
}

TEST_CASE("what does not say is unknown") {
  const turbomap::image_bounds image{0, 0, 640, 480};
  const auto own = turbomap::measure_resolution(equisolid_camera{}, image);
  CHECK_FALSE(own.known());
  CHECK_FALSE(resolution_profile{}.known());
  for (const float p : own.pixels_per_radian) CHECK(p == 0);
  // A model that is not defined in a corner of the image has no bound there.
  turbomap::kannala_brandt<double> folds{100, 100, 320, 240};
  folds.k1 = -0.2;
  CHECK_FALSE(turbomap::measure_resolution(folds, image).known());
}

TEST_CASE("entries by cosine, also by what is none") {
  resolution_profile p;
  for (int i = 0; i < resolution_profile::entries; ++i) p.pixels_per_radian[i] = static_cast<float>(i + 1);
  CHECK(p.at(1) == 1);
  CHECK(p.at(1 - 0.99F / 16) == 1);
  CHECK(p.at(1 - 1.01F / 16) == 2);
  CHECK(p.at(0) == 17);
  CHECK(p.at(-0.99F) == 32);
  CHECK(p.at(-1) == 32);
  CHECK(p.at(std::nextafter(1.0F, 2.0F)) == 1);
  CHECK(p.at(std::nextafter(-1.0F, -2.0F)) == 32);
  CHECK(p.at(1e30F) == 1);
  CHECK(p.at(-1e30F) == 32);
  CHECK(p.at(std::numeric_limits<float>::infinity()) == 1);
  CHECK(p.at(-std::numeric_limits<float>::infinity()) == 32);
  CHECK(p.at(std::numeric_limits<float>::quiet_NaN()) == 1);
}

}  // namespace
