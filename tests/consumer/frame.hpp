// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The user's own keyframe type, how the library reads it, and a short made-up sequence. Shared by .cpp and .cu files.

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/traits.hpp>

namespace my {

struct feature {
  float u, v;
  std::array<std::uint8_t, 32> descriptor;
};
/// Looks along +z from (x, 0, 0).
struct frame {
  double x;
  std::vector<feature> features;

  turbomap::rigid_transform<double> pose() const { return {0, 0, 0, 1, -x, 0, 0}; }  // T_cw
};

/// The scene point that feature i of every frame sees.
inline std::array<double, 3> scene_point(int i) { return {(i % 25 - 12) * 0.2, (i / 25 - 8) * 0.2, 5 + i % 7 * 0.3}; }

/// Three frames of 400 features, 0.4 m apart, without noise but for 5 descriptor bits.
inline std::vector<frame> make_frames() {
  std::mt19937 random(1);
  std::vector<frame> frames;
  for (int k = 0; k < 3; ++k) {
    frames.push_back({0.4 * k, {}});
    for (int i = 0; i < 400; ++i) {
      const auto [x, y, z] = scene_point(i);
      feature f{static_cast<float>(400 * (x - 0.4 * k) / z + 320), static_cast<float>(400 * y / z + 240), {}};
      std::mt19937 of_point(static_cast<unsigned>(i));
      for (auto& byte : f.descriptor) byte = static_cast<std::uint8_t>(of_point());
      for (int flip = 0; flip < 5; ++flip) f.descriptor[random() % 32] ^= static_cast<std::uint8_t>(1U << random() % 8);
      frames.back().features.push_back(f);
    }
  }
  return frames;
}

}  // namespace my

template <>
struct turbomap::keyframe_traits<my::frame> {
  using descriptor = turbomap::binary_descriptor<256>;
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static rig cameras(const my::frame&) { return turbomap::make_mono_rig(turbomap::pinhole<float>{400, 400, 320, 240}); }
  static std::size_t keypoint_count(const my::frame& f) { return f.features.size(); }
  static turbomap::keypoint keypoint(const my::frame& f, std::size_t i) {
    turbomap::keypoint k;
    k.x = f.features[i].u, k.y = f.features[i].v;
    return k;
  }
  static const std::uint8_t* descriptor_data(const my::frame& f, std::size_t i) {
    return f.features[i].descriptor.data();
  }
  static turbomap::image_bounds bounds(const my::frame&) { return {0, 0, 640, 480}; }
};
