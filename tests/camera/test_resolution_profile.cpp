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
