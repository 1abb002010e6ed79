// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The keypoints of one simulated keyframe: which points are seen, where, at which pyramid level, and what else an
/// extractor finds.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <turbomap/io/recording_data.hpp>

#include "descriptors.hpp"
#include "random.hpp"
#include "rig.hpp"
#include "scene.hpp"

namespace turbomap::simulation {

struct observation_options {
  double scale_factor = 1.2;
  int levels = 8;
  double detected = 0.8;        ///< share of the visible points that an extractor finds in one image
  double clutter = 0.2;         ///< share of the keypoints, at least, that show no scene point
  double octave_jitter = 0.15;  ///< chance each to be found one level finer or coarser than predicted
  double strength_noise =
      0.5;                    ///< how much what an extractor prefers changes from view to view; strengths are in [0, 1)
  double angle_noise = 7;     ///< degrees, standard deviation
  double least_cosine = 0.3;  ///< between viewing ray and surface normal
  double stereo = 0.6;        ///< share of the keypoints with a partner in the other image that stereo matching finds
  double features_spread = 15;                             ///< keypoints per image vary by about as many
  int margin = 19;                                         ///< px without keypoints at the image's border
  double clutter_depth_least = 1, clutter_depth_most = 6;  ///< m, of wrong stereo matches
};

/// One keyframe's keypoints, the left camera's first, and the truth about them.
struct keyframe_observation {
  std::vector<keypoint> keypoints;
  std::vector<descriptor_bytes> descriptors;
  std::vector<std::int32_t> point;           ///< scene point, -1: clutter
  std::vector<std::int32_t> stereo_partner;  ///< fisheye
  std::size_t left_count = 0;
};

class observer {
 public:
  observer(const simulated_rig& rig, const scene& scene, const std::vector<scene_point>& points,
           const descriptor_model& descriptors, const observation_options& options, std::uint64_t seed)
      : rig_(rig), scene_(scene), points_(points), descriptors_(descriptors), options_(options), seed_(seed) {}

  /// Is the point seen by the camera at T_wc; at which pixel and predicted level (float: before rounding up)?
  bool sees(const simulated_camera& camera, const Eigen::Isometry3d& T_wc, const scene_point& p, Eigen::Vector2d& pixel,
            int& octave) const {
    const Eigen::Vector3d ray = p.position - T_wc.translation();
    const double distance = ray.norm();
    if (distance > p.range_max || -ray.dot(p.normal) < options_.least_cosine * distance) return false;
    double range = p.range_max / options_.scale_factor;  // a table, not a logarithm: exact on every machine
    for (octave = 0; octave < options_.levels && distance <= range; ++octave) range /= options_.scale_factor;
    if (octave >= options_.levels) return false;
    return camera.project(T_wc.inverse() * p.position, pixel) && inside(camera, pixel) &&
           scene_.visible(T_wc.translation(), p.position);
  }

  std::size_t visible_count(const Eigen::Isometry3d& T_wb) const {
    Eigen::Vector2d pixel;
    int octave;
    return static_cast<std::size_t>(std::count_if(points_.begin(), points_.end(), [&](const scene_point& p) {
      return sees(rig_.cameras[0], T_wb * rig_.cameras[0].T_bc, p, pixel, octave);
    }));
  }

  keyframe_observation observe(std::uint64_t keyframe, const Eigen::Isometry3d& T_wb) const {
    keyframe_observation all;
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      add_camera(keyframe, c, T_wb * rig_.cameras[c].T_bc, all);
      if (c == 0) all.left_count = all.keypoints.size();
    }
    all.stereo_partner.assign(all.keypoints.size(), -1);
    if (rig_.cameras.size() == 2) match_fisheye(keyframe, T_wb, all);
    return all;
  }

 private:
  struct candidate {
    keypoint seen;
    std::int32_t point;
    double strength;
  };

  bool inside(const simulated_camera& camera, const Eigen::Vector2d& px) const {
    return px.x() >= options_.margin && px.x() <= camera.width - options_.margin - 1 && px.y() >= options_.margin &&
           px.y() <= camera.height - options_.margin - 1;
  }
  double sigma(int octave) const { return rig_.noise_px * std::pow(options_.scale_factor, octave); }

  void add_camera(std::uint64_t keyframe, std::size_t c, const Eigen::Isometry3d& T_wc,
                  keyframe_observation& all) const {
    const simulated_camera& camera = rig_.cameras[c];
    std::vector<std::vector<candidate>> levels(static_cast<std::size_t>(options_.levels));
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Eigen::Vector2d pixel;
      int octave;
      if (!sees(camera, T_wc, points_[i], pixel, octave)) continue;
      random_stream random(seed_, purpose::observation, keyframe, c, i);
      if (!random.chance(options_.detected)) continue;
      const double jitter = random.uniform();
      octave += jitter < options_.octave_jitter ? -1 : jitter > 1 - options_.octave_jitter ? 1 : 0;
      octave = std::clamp(octave, 0, options_.levels - 1);
      candidate found{
          {}, static_cast<std::int32_t>(i), points_[i].strength + options_.strength_noise * random.uniform()};
      found.seen = measure(camera, c, T_wc, points_[i], pixel, octave, random);
      if (inside(camera, {found.seen.x, found.seen.y})) levels[static_cast<std::size_t>(octave)].push_back(found);
    }
    random_stream random(seed_, purpose::clutter, keyframe, c);
    const double total = rig_.features + options_.features_spread * (random.normal() - 1);
    double weight = 0;
    for (int o = 0; o < options_.levels; ++o) weight += std::pow(options_.scale_factor, -o);
    for (int o = 0; o < options_.levels; ++o) {
      auto& level = levels[static_cast<std::size_t>(o)];
      const auto wanted = static_cast<std::size_t>(total * std::pow(options_.scale_factor, -o) / weight);
      std::stable_sort(level.begin(), level.end(),
                       [](const auto& a, const auto& b) { return a.strength > b.strength; });
      const auto most = static_cast<std::size_t>((1 - options_.clutter) * static_cast<double>(wanted));
      if (level.size() > most) level.resize(most);
      while (level.size() < wanted) level.push_back({clutter(camera, c, o, random), -1, random.uniform()});
      // An extractor lists a level's keypoints in no order that follows from what they show.
      std::stable_sort(level.begin(), level.end(), [](const auto& a, const auto& b) { return a.seen.y < b.seen.y; });
      for (const candidate& k : level) add_keypoint(keyframe, c, k, all);
    }
  }

  keypoint measure(const simulated_camera& camera, std::size_t c, const Eigen::Isometry3d& T_wc, const scene_point& p,
                   const Eigen::Vector2d& pixel, int octave, random_stream& random) const {
    keypoint k;
    k.x = static_cast<float>(pixel.x() + sigma(octave) * random.normal());
    k.y = static_cast<float>(pixel.y() + sigma(octave) * random.normal());
    k.octave = static_cast<std::uint8_t>(octave), k.camera = static_cast<std::uint8_t>(c);
    const Eigen::Vector3d x = T_wc.inverse() * p.position, ahead = T_wc.inverse() * (p.position + 1e-4 * p.tangent);
    Eigen::Vector2d tip = pixel + Eigen::Vector2d(1, 0);
    camera.project(ahead, tip);
    const double radians = std::atan2(tip.y() - pixel.y(), tip.x() - pixel.x());
    k.angle = wrapped(radians * (180 / 3.14159265358979323846) + options_.angle_noise * random.normal());
    const double disparity = rig_.focal() * rig_.baseline / x.z() +
                             rig_.disparity_noise_px * std::pow(options_.scale_factor, octave) * random.normal();
    if (rig_.rectified() && random.chance(options_.stereo)) set_stereo(k, k.x - disparity);
    return k;
  }
  keypoint clutter(const simulated_camera& camera, std::size_t c, int octave, random_stream& random) const {
    keypoint k;
    k.x = static_cast<float>(random.uniform(options_.margin, camera.width - options_.margin - 1));
    k.y = static_cast<float>(random.uniform(options_.margin, camera.height - options_.margin - 1));
    k.octave = static_cast<std::uint8_t>(octave), k.camera = static_cast<std::uint8_t>(c);
    k.angle = wrapped(random.uniform(0, 360));
    const double depth = random.uniform(options_.clutter_depth_least, options_.clutter_depth_most);
    if (rig_.rectified() && random.chance(options_.stereo)) set_stereo(k, k.x - rig_.focal() * rig_.baseline / depth);
    return k;
  }
  static float wrapped(double degrees) {
    const auto angle = static_cast<float>(degrees - 360 * std::floor(degrees / 360));
    return angle < 360 ? angle : 0;
  }
  void set_stereo(keypoint& k, double u_right) const {
    const float right = static_cast<float>(u_right), disparity = k.x - right;
    if (!(right >= 0) || !(disparity > 0.1F)) return;
    k.u_right = right, k.depth = static_cast<float>(rig_.focal() * rig_.baseline) / disparity;
  }

  void add_keypoint(std::uint64_t keyframe, std::size_t c, const candidate& found, keyframe_observation& all) const {
    random_stream random(seed_, purpose::point_detail, keyframe, c, all.keypoints.size());
    descriptor_bytes bytes;
    if (found.point >= 0) {
      const auto i = static_cast<std::uint64_t>(found.point);
      bytes = descriptors_.observe(descriptors_.patch(random_stream(seed_, purpose::point_descriptor, i)), random);
    } else {
      bytes = descriptors_.observe(descriptors_.patch(random_stream(random.next(), purpose::clutter)), random);
    }
    all.keypoints.push_back(found.seen);
    all.keypoints.back().group = descriptors_.group(bytes);
    all.descriptors.push_back(bytes);
    all.point.push_back(found.point);
  }

  /// Partners between the two fisheye images, and the left one's depth with the error that triangulation would have.
  void match_fisheye(std::uint64_t keyframe, const Eigen::Isometry3d& T_wb, keyframe_observation& all) const {
    std::vector<std::int32_t> right_of(points_.size(), -1);
    for (std::size_t k = all.left_count; k < all.keypoints.size(); ++k)
      if (all.point[k] >= 0) right_of[static_cast<std::size_t>(all.point[k])] = static_cast<std::int32_t>(k);
    const Eigen::Isometry3d T_cw = (T_wb * rig_.cameras[0].T_bc).inverse();
    for (std::size_t k = 0; k < all.left_count; ++k) {
      if (all.point[k] < 0 || right_of[static_cast<std::size_t>(all.point[k])] < 0) continue;
      random_stream random(seed_, purpose::tracking, keyframe, k, 1);
      if (!random.chance(options_.stereo)) continue;
      const auto partner = static_cast<std::size_t>(right_of[static_cast<std::size_t>(all.point[k])]);
      all.stereo_partner[k] = static_cast<std::int32_t>(partner);
      all.stereo_partner[partner] = static_cast<std::int32_t>(k);
      const double z = (T_cw * points_[static_cast<std::size_t>(all.point[k])].position).z();
      const double inverse_error = sigma(all.keypoints[k].octave) / (rig_.focal() * rig_.baseline) * random.normal();
      const double inverse_depth = 1 / z + inverse_error;
      if (inverse_depth > 0.01) all.keypoints[k].depth = static_cast<float>(1 / inverse_depth);
    }
  }

  const simulated_rig& rig_;
  const scene& scene_;
  const std::vector<scene_point>& points_;
  const descriptor_model& descriptors_;
  observation_options options_;
  std::uint64_t seed_;
};

}  // namespace turbomap::simulation
