// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Pixels per radian of cameras that no lens is like, for images of any size. Of lenses, and of images that they can have, the
// profile is a lower bound for pixels near one another, and no ring is above what is measured in it.

#include <algorithm>
#include <cmath>
#include <limits>

#include <turbomap/camera/measure_resolution.hpp>

#include "hostile.hpp"
#include "hostile_cameras.hpp"
#include "reference/eigen.hpp"

using namespace turbomap_fuzz;

namespace {

using turbomap::image_bounds;
using turbomap::resolution_profile;
using turbomap::vec2;
using turbomap::vec3;

constexpr int entries = resolution_profile::entries;

Eigen::Vector3d to_eigen(const vec3<double>& v) { return {v.x, v.y, v.z}; }
/// Between unit rays, exact for small ones too.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

TURBOMAP_TEST_EIGEN_BEGIN
/// The least singular value of the pixel's derivative by the unit ray, by differences across it; NaN beside the model.
template <class Camera>
double least_resolution(const Camera& camera, const Eigen::Vector3d& ray) {
  constexpr double step = 1e-5;
  const Eigen::Vector3d across = ray.unitOrthogonal(), up = ray.cross(across);
  Eigen::Matrix2d J;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d d = step * (i == 0 ? across : up), a = ray + d, b = ray - d;
    vec2<double> p{}, q{};
    if (!camera.project(vec3<double>{a.x(), a.y(), a.z()}, p) || !camera.project(vec3<double>{b.x(), b.y(), b.z()}, q))
      return std::numeric_limits<double>::quiet_NaN();
    J(0, i) = (p.x - q.x) / (2 * step), J(1, i) = (p.y - q.y) / (2 * step);
  }
  return J.jacobiSvd().singularValues()(1);
}
TURBOMAP_TEST_EIGEN_END

/// The least of 9 angles and 64 directions within an entry, infinite where none has a pixel. NaN: a sample stands at the border
/// of the image or of the model.
template <class Camera>
double plain_entry(const Camera& camera, const image_bounds& b, double least, int entry) {
  const double pi = std::acos(-1), reach = resolution_profile::margin / least, margin = resolution_profile::margin;
  const double from = std::max(std::acos(1 - entry / 16.0) - reach, 0.0);
  const double to = std::min(std::acos(1 - (entry + 1) / 16.0) + reach, pi);
  double smallest = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 9; ++a)
    for (int d = 0; d < 64; ++d) {
      const double theta = from + (to - from) * a / 8, phi = 2 * pi * d / 64;
      const Eigen::Vector3d ray(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
      vec2<double> p{};
      if (!camera.project(vec3<double>{ray.x(), ray.y(), ray.z()}, p)) continue;
      const double out =
          std::max({b.min_x - margin - p.x, p.x - b.max_x - margin, b.min_y - margin - p.y, p.y - b.max_y - margin});
      if (out > 1e-6) continue;
      const double resolution = least_resolution(camera, ray);
      if (std::isnan(resolution) || out > -1e-6) return std::numeric_limits<double>::quiet_NaN();
      smallest = std::min(smallest, resolution);
    }
  return smallest;
}

/// An entry for every cosine: the one whose ring holds it; at a border of two, either.
void expect_rings(const resolution_profile& profile, choices& c) {
  const float cosine = c.single(1.5);
  const float found = profile.at(cosine);
  if (!(cosine < 1)) return expect(found == profile.pixels_per_radian[0], "beyond the axis is the first ring");
  if (cosine < -1) return expect(found == profile.pixels_per_radian[entries - 1], "behind is the last ring");
  bool mine = false;
  for (int i = 0; i < entries; ++i) {
    const double inner = 1 - i / 16.0, outer = 1 - (i + 1) / 16.0, rounding = 1e-6;
    if (cosine <= inner + rounding && cosine >= outer - rounding) mine = mine || found == profile.pixels_per_radian[i];
  }
  expect(mine, "a cosine is in its ring");
}

/// Pixels at most `margin` apart are as far apart as the profile says, at least.
template <class Camera>
void expect_bound(const Camera& camera, const image_bounds& b, const resolution_profile& profile, choices& c) {
  const auto between = [&](double low, double high) { return low + (high - low) * c.word() / 65535.0; };
  const vec2<double> p{between(b.min_x, b.max_x), between(b.min_y, b.max_y)};
  const double away = resolution_profile::margin * (1 + c.byte()) / 256, phi = between(0, 6.283);
  const vec2<double> q{p.x + away * std::cos(phi), p.y + away * std::sin(phi)};
  if (q.x < b.min_x || q.x > b.max_x || q.y < b.min_y || q.y > b.max_y) return;
  vec3<double> r{}, s{};
  expect(camera.unproject(p, r) && camera.unproject(q, s), "a profile is known where every pixel has a ray");
  const double angle = angle_between(to_eigen(r), to_eigen(s));
  for (const double z : {r.z, s.z})
    expect(away >= profile.at(static_cast<float>(z)) * angle * (1 - 1e-6), "the profile is a lower bound");
}

image_bounds draw_image(const image_bounds& usual, bool hostile, choices& c) {
  image_bounds b = usual;
  if (hostile) {
    float* const all[] = {&b.min_x, &b.min_y, &b.max_x, &b.max_y};
    for (unsigned n = 1 + c.byte() % 3; n > 0; --n) *all[c.below(4)] = c.single(2000);
  } else if (c.flag()) {  // a part of it
    b.max_x = b.min_x + (b.max_x - b.min_x) * static_cast<float>(1 + c.byte()) / 256;
    b.max_y = b.min_y + (b.max_y - b.min_y) * static_cast<float>(1 + c.byte()) / 256;
  }
  return b;
}

template <class Camera>
void run(turbomap_test::test_rig<Camera> rig, choices& c) {
  const auto how = static_cast<lens>(c.below(3));
  if (!bend(rig, how, c)) return;
  const Camera& camera = rig.cameras[0].camera;
  const bool hostile_image = c.byte() % 4 == 3;
  const image_bounds image = draw_image(rig.bounds, hostile_image, c);
  if (!(image.max_x > image.min_x && image.max_y > image.min_y)) return;  // what insertion refuses
  if (!finite({image.max_x - image.min_x, image.max_y - image.min_y})) return;
  const resolution_profile profile = turbomap::measure_resolution(camera, image);
  const double least = turbomap::min_pixels_per_radian(camera, image);
  expect(least >= 0, "the least resolution is a number");
  for (const float p : profile.pixels_per_radian)
    expect(p >= static_cast<float>(least), "no ring is below the least of the image");
  const bool varies = std::any_of(std::begin(profile.pixels_per_radian), std::end(profile.pixels_per_radian),
                                  [](float p) { return p > 0; });
  expect(profile.known() == varies, "a profile is known as a whole");
  for (int n = 0; n < 8; ++n) expect_rings(profile, c);
  if (how == lens::hostile || hostile_image || !profile.known()) return;

  if constexpr (turbomap::has_jacobian_v<Camera>)
    for (int i = 0; i < entries; ++i) {
      const double plain = plain_entry(camera, image, least, i);
      if (!std::isnan(plain))
        expect(profile.pixels_per_radian[i] <= std::max(plain, least) * (1 + 1e-4), "no ring is above what is in it");
    }
  if (how != lens::real) return;  // what lies between the samples is left to lenses
  for (int n = 0; n < 16; ++n) expect_bound(camera, image, profile, c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  return run_on_models(c, 16, [&](const auto& rig) { run(rig, c); });
}
