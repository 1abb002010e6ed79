// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The resolution of cameras that come unmeasured, remembered: keyframe after keyframe has the same rig.

#include <cstddef>
#include <cstring>
#include <vector>

#include "../camera/resolution_profile.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One entry per camera of the rig: what was measured last, and of what.
class measured_cameras {
 public:
  /// measure_resolution() of camera `index`, computed only when the camera or the image has changed.
  template <class Camera>
  const resolution_profile& of(std::size_t index, const Camera& camera, const image_bounds& image) {
    if (entries_.size() <= index) entries_.resize(index + 1);
    entry& e = entries_[index];
    if (e.camera.size() != sizeof camera || std::memcmp(e.camera.data(), &camera, sizeof camera) != 0 ||
        std::memcmp(&e.image, &image, sizeof image) != 0) {
      e.camera.clear();
      e.profile = measure_resolution(camera, image);
      e.image = image;
      const auto* bytes = reinterpret_cast<const std::byte*>(&camera);
      e.camera.assign(bytes, bytes + sizeof camera);
    }
    return e.profile;
  }

 private:
  struct entry {
    std::vector<std::byte> camera;  // bytes: a difference in padding only measures once more
    image_bounds image;
    resolution_profile profile;
  };
  std::vector<entry> entries_;
};

TURBOMAP_END_NAMESPACE
