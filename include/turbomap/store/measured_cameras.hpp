// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Remembers the measured resolution of cameras, since all keyframes of a system have the same rig.

#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include "../camera/measure_resolution.hpp"
#include "../camera/resolution_profile.hpp"
#include "../config.hpp"
#include "../plain_vector.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One entry per camera of the rig: what was measured, and of what image. A bound for an image is one for every part of
/// it, so where images are no more than what their keypoints span, a few measurements serve all that come.
class measured_cameras {
 public:
  /// measure_resolution() of camera `index` for `image` or a larger one that has been seen. Measures only when the
  /// camera has changed, or for an image that reaches out of those before.
  template <class Camera>
  const resolution_profile& of(std::size_t index, const Camera& camera, const image_bounds& image) {
    if (entries_.size() <= index) entries_.resize(index + 1);
    entry& e = entries_[index];
    const auto* bytes = reinterpret_cast<const std::byte*>(&camera);
    const bool same = e.camera.size() == sizeof camera && std::memcmp(e.camera.data(), bytes, sizeof camera) == 0;
    if (!same || !e.profile.known()) {
      if (same && std::memcmp(&e.image, &image, sizeof image) == 0) return e.profile;
      e.camera.clear();
      e.profile = measure_resolution(camera, image);
      e.image = image;
      e.camera.assign(bytes, bytes + sizeof camera);
    } else if (!contains(e.image, image)) {
      const image_bounds wider = both(e.image, image);
      const resolution_profile profile = measure_resolution(camera, wider);
      if (!profile.known()) {  // a keypoint where the model is not defined must not spoil what comes after
        e.other = measure_resolution(camera, image);
        return e.other;
      }
      e.profile = profile;
      e.image = wider;
    }
    return e.profile;
  }

 private:
  /// px; images grow by multiples of it, so that they soon stop growing.
  static constexpr float step = 64;

  static bool contains(const image_bounds& a, const image_bounds& b) {
    return a.min_x <= b.min_x && a.min_y <= b.min_y && a.max_x >= b.max_x && a.max_y >= b.max_y;
  }
  /// What holds both, each side that `b` moves rounded outwards.
  static image_bounds both(const image_bounds& a, const image_bounds& b) {
    return {b.min_x < a.min_x ? step * std::floor(b.min_x / step) : a.min_x,
            b.min_y < a.min_y ? step * std::floor(b.min_y / step) : a.min_y,
            b.max_x > a.max_x ? step * std::ceil(b.max_x / step) : a.max_x,
            b.max_y > a.max_y ? step * std::ceil(b.max_y / step) : a.max_y};
  }

  struct entry {
    plain_vector<std::byte> camera;  // bytes: a difference in padding only measures once more
    image_bounds image;
    resolution_profile profile;
    resolution_profile other;
  };
  std::vector<entry> entries_;
};

TURBOMAP_END_NAMESPACE
