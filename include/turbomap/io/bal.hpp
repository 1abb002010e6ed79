// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Reads problems of "Bundle Adjustment in the Large" [Agarwal, Snavely, Seitz, Szeliski, ECCV 2010]:
///
///     CAMERAS POINTS OBSERVATIONS
///     camera point x y                    one line per observation, px
///     ...                                 nine numbers per camera, then three per point, m
///
/// Pixels are relative to the image centre, x right, y up, and a camera looks along its negative z axis:
/// P = R X + t, p = -(P.x, P.y) / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p.

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../types.hpp"
#include "text_reader.hpp"

namespace turbomap {

/// A camera of a BAL problem as it lies in the file.
struct bal_camera {
  vec3<double> rotation;     ///< axis times angle, rad; world to camera
  vec3<double> translation;  ///< m
  double f;                  ///< focal length, px
  double k1;                 ///< radial, of r^2
  double k2;                 ///< radial, of r^4
};

/// A whole problem. Every index is inside its array, every number and every angle finite.
struct bal_problem {
  std::vector<bal_camera> cameras;   ///< by number
  std::vector<vec3<double>> points;  ///< world, m
  std::vector<std::int32_t> camera;  ///< of each observation
  std::vector<std::int32_t> point;   ///< of each observation
  std::vector<vec2<double>> pixel;   ///< of each observation; relative to the image centre, y up
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// The pose `T_cw` of a BAL camera, which looks along -z.
inline rigid_transform<double> bal_pose(const bal_camera& camera) {
  const vec3<double>&w = camera.rotation, &t = camera.translation;
  const double angle = std::sqrt(w.x * w.x + w.y * w.y + w.z * w.z);
  const double s = angle > 1e-9 ? std::sin(angle / 2) / angle : 0.5;  // below, sine and angle are equal numbers
  return {s * w.x, s * w.y, s * w.z, std::cos(angle / 2), t.x, t.y, t.z};
}

/// Reads a problem. Throws bad_file naming file, line and reason: a number that is none or not finite, an index outside
/// its array, fewer or more numbers than the first line says. Linear in the size of the file.
inline bal_problem read_bal(const std::filesystem::path& file) {
  detail::text_reader in(file);
  const auto count = [&](const char* what) {
    const auto n = in.take<std::int32_t>(what);
    if (n < 0) in.fail(std::string(what) + " is negative");
    return static_cast<std::size_t>(n);
  };
  const std::size_t cameras = count("number of cameras"), points = count("number of points"),
                    observations = count("number of observations");
  if ((4 * observations + 9 * cameras + 3 * points) > in.left() / 2 + 1)
    in.fail("the file is too short for " + std::to_string(cameras) + " cameras, " + std::to_string(points) +
            " points and " + std::to_string(observations) + " observations");
  bal_problem p;
  p.camera.resize(observations), p.point.resize(observations), p.pixel.resize(observations);
  for (std::size_t i = 0; i < observations; ++i) {
    const auto index = [&](const char* what, std::size_t end) {
      const auto value = in.take<std::int32_t>(what);
      if (value < 0 || static_cast<std::size_t>(value) >= end)
        in.fail(std::string(what) + " " + std::to_string(value) + " is not one of " + std::to_string(end));
      return value;
    };
    p.camera[i] = index("camera", cameras), p.point[i] = index("point", points);
    p.pixel[i].x = in.take<double>("x"), p.pixel[i].y = in.take<double>("y");
  }
  const auto vector = [&](const char* what) {
    vec3<double> v;
    v.x = in.take<double>(what), v.y = in.take<double>(what), v.z = in.take<double>(what);
    return v;
  };
  p.cameras.resize(cameras), p.points.resize(points);
  for (bal_camera& c : p.cameras) {
    c.rotation = vector("rotation");
    if (!std::isfinite(c.rotation.x * c.rotation.x + c.rotation.y * c.rotation.y + c.rotation.z * c.rotation.z))
      in.fail("the rotation is too large");
    c.translation = vector("translation");
    c.f = in.take<double>("focal length"), c.k1 = in.take<double>("k1"), c.k2 = in.take<double>("k2");
  }
  for (vec3<double>& x : p.points) x = vector("point coordinate");
  if (!in.file_ends()) in.fail("there is more than the first line says");
  return p;
}

TURBOMAP_END_NAMESPACE
