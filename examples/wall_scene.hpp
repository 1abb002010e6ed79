// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small simulated scene for the examples of local mapping: a rectified stereo pair slides along a cluttered wall,
/// looking at it. Every keypoint knows which landmark it shows, so that a map can be judged.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/camera/rig.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/types.hpp>
#include <vector>

namespace example {

using orb = turbomap::binary_descriptor<256>;
using camera = turbomap::pinhole<float>;

constexpr camera left_camera{400, 400, 320, 240};
constexpr double baseline = 0.1;   ///< m
constexpr double close_depth = 5;  ///< m, 50 baselines: farther points do not make a keyframe redundant
constexpr turbomap::image_bounds image{0, 0, 640, 480};

/// What one image shows, as flat arrays.
struct wall_view {
  turbomap::rigid_transform<double> T_cw;
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;  ///< 32 bytes per keypoint
  std::vector<int> landmark;              ///< the truth
};

/// Landmarks 4 to 7 m away on 18 m of wall.
class wall_scene {
 public:
  explicit wall_scene(unsigned seed = 2) : random_(seed) {
    std::uniform_real_distribution<double> along(-5, 13), height(-2.5, 2.5), depth(4, 7), size(6, 14);
    for (int i = 0; i < 900; ++i) {
      landmarks_.push_back({{along(random_), height(random_), depth(random_)}, size(random_), {}});
      for (auto& byte : landmarks_.back().descriptor) byte = static_cast<std::uint8_t>(random_());
    }
  }
  const turbomap::vec3<double>& landmark(int i) const { return landmarks_[static_cast<std::size_t>(i)].position; }

  /// The left camera at (x, y, 0): noise of 0.3 px at the finest level, 15 of 256 descriptor bits flipped.
  wall_view look_from(double x, double y) {
    std::normal_distribution<double> noise(0, 0.3);
    wall_view view;
    view.T_cw.tx = -x, view.T_cw.ty = -y;
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      const auto& l = landmarks_[i];
      const turbomap::vec3<double> in_camera{l.position.x - x, l.position.y - y, l.position.z};
      turbomap::vec2<double> pixel{-1, -1};
      left_camera.project(in_camera, pixel);
      if (pixel.x < image.min_x || pixel.x >= image.max_x || pixel.y < image.min_y || pixel.y >= image.max_y) continue;
      // The level at which a detector finds a thing of this size at this distance.
      const double distance =
          std::sqrt(in_camera.x * in_camera.x + in_camera.y * in_camera.y + in_camera.z * in_camera.z);
      const double level = std::clamp(std::round(std::log(l.size / distance) / std::log(1.2)), 0., 7.);
      const double sigma = std::pow(1.2, level);
      turbomap::keypoint k;
      k.octave = static_cast<std::uint8_t>(level);
      k.x = static_cast<float>(pixel.x + sigma * noise(random_));
      k.y = static_cast<float>(pixel.y + sigma * noise(random_));
      const double disparity = left_camera.fx * baseline / in_camera.z + 0.3 * sigma * noise(random_);
      k.u_right = k.x - static_cast<float>(disparity);
      k.depth = static_cast<float>(left_camera.fx * baseline / disparity);
      view.keypoints.push_back(k);
      view.landmark.push_back(static_cast<int>(i));
      auto seen = l.descriptor;
      for (int flip = 0; flip < 15; ++flip) seen[random_() % 32] ^= static_cast<std::uint8_t>(1U << random_() % 8);
      view.descriptors.insert(view.descriptors.end(), seen.begin(), seen.end());
    }
    return view;
  }

 private:
  struct thing {
    turbomap::vec3<double> position;
    double size;  ///< m: the distance at which it is found at the finest level
    std::array<std::uint8_t, 32> descriptor;
  };
  std::mt19937 random_;
  std::vector<thing> landmarks_;
};

/// World position of a stereo keypoint.
inline turbomap::vec3<double> back_project(const wall_view& view, std::size_t i) {
  const turbomap::keypoint& k = view.keypoints[i];
  const auto depth = static_cast<double>(k.depth);
  return {(k.x - left_camera.cx) / left_camera.fx * depth - view.T_cw.tx,
          (k.y - left_camera.cy) / left_camera.fy * depth - view.T_cw.ty, depth};
}

}  // namespace example
