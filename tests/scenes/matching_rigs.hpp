// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Rigs of every kind that the searches are tested with.

#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/double_sphere.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>

#include <cmath>
#include <vector>

namespace turbomap_test {

/// A user's own model: equisolid, u = 2 f sin(theta / 2) in every direction. It has none of the optional members.
struct equisolid_camera {
  using scalar = double;
  double f = 250, cx = 320, cy = 240;

  template <class S>
  TURBOMAP_HD bool project(const turbomap::vec3<S>& p, turbomap::vec2<S>& pixel) const {
    using std::sqrt;
    const S d = sqrt(p.x * p.x + p.y * p.y + p.z * p.z), down = S(d + p.z);
    if (!(down > S(1e-6) * d)) return false;  // straight behind, or the centre
    // 2 sin(theta / 2) / sin(theta) = sqrt(2 d / (d + z))
    const S scale = S(f) * sqrt(S(2) * d / down) / d;
    pixel = {scale * p.x + S(cx), scale * p.y + S(cy)};
    return true;
  }
  template <class S>
  TURBOMAP_HD bool unproject(const turbomap::vec2<S>& pixel, turbomap::vec3<S>& bearing) const {
    using std::sqrt;
    const S x = (pixel.x - S(cx)) / S(f), y = (pixel.y - S(cy)) / S(f), r2 = x * x + y * y;
    if (!(r2 < S(4))) return false;
    const S c = sqrt(S(1) - r2 / S(4));
    bearing = {x * c, y * c, S(1) - r2 / S(2)};
    return true;
  }
};

template <class Camera>
struct test_rig {
  std::vector<turbomap::rig_camera<Camera>> cameras;
  turbomap::image_bounds bounds;
};

using pinhole_camera = turbomap::pinhole<float>;
using fisheye_camera = turbomap::kannala_brandt<float>;
using mixed_camera = turbomap::any_camera<turbomap::pinhole<float>, turbomap::kannala_brandt<float>>;

/// A mount of the second camera: 10 cm to the side, turned by a few degrees.
inline turbomap::rigid_transform<double> beside(double degrees = 4) {
  turbomap::rigid_transform<double> T;
  T.qy = std::sin(degrees * 3.14159265358979 / 360), T.qw = std::cos(degrees * 3.14159265358979 / 360);
  T.tx = -0.1, T.ty = 0.002, T.tz = 0.001;
  return T;
}

/// bf > 0: a rectified stereo pair of 11 cm.
inline test_rig<pinhole_camera> pinhole_rig(double bf = 0, float focal = 458) {
  return {{{pinhole_camera{focal, focal - 1, 367, 248}, {}, bf, {}}}, {0, 0, 752, 480}};
}
/// `bend` scales the distortion; the corners of a 512 x 512 image are then 100 degrees and more off the axis.
inline fisheye_camera fisheye(float bend = 1) {
  return {190.98F,
          190.97F,
          254.9F,
          256.9F,
          0.0034823894F * bend,
          0.0007150348F * bend,
          -0.0020532361F * bend,
          0.00020293673F * bend};
}
inline test_rig<fisheye_camera> fisheye_rig(int cameras = 2) {
  test_rig<fisheye_camera> rig{{{fisheye(), {}, 0, {}}}, {0, 0, 512, 512}};
  if (cameras > 1) rig.cameras.push_back({fisheye(1.02F), beside(), 0, {}});
  if (cameras > 2) rig.cameras.push_back({fisheye(0.9F), beside(90), 0, {}});
  return rig;
}
inline test_rig<mixed_camera> mixed_rig() {
  return {{{mixed_camera(pinhole_camera{300, 301, 256, 255}), {}, 0, {}}, {mixed_camera(fisheye()), beside(), 0, {}}},
          {0, 0, 512, 512}};
}
inline test_rig<turbomap::double_sphere<double>> double_sphere_rig() {
  return {{{turbomap::double_sphere<double>{157, 157, 254, 256, -0.18, 0.59}, {}, 0, {}}}, {0, 0, 512, 512}};
}
inline test_rig<turbomap::brown_conrady<double>> brown_conrady_rig() {
  turbomap::brown_conrady<double> c{458, 457, 367, 248};
  c.k1 = -0.28, c.k2 = 0.074, c.p1 = 0.0002, c.p2 = 1.8e-5;
  return {{{c, {}, 0, {}}, {c, beside(), 0, {}}}, {0, 0, 752, 480}};
}
inline test_rig<equisolid_camera> equisolid_rig() { return {{{equisolid_camera{}, {}, 0, {}}}, {0, 0, 640, 480}}; }

}  // namespace turbomap_test
