// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracking's stand-in: which keypoints of a keyframe show a point that an earlier one saw. Points of the last keyframes are
/// projected with the recorded poses, and the keypoint nearby with the nearest descriptor is taken. What has a depth and no
/// point becomes one. So local mapping gets what it gets from a tracking system, without its adjustments.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <turbomap/io/recording_writer.hpp>

#include "grid_features.hpp"
#include "simulation/descriptors.hpp"
#include "simulation/rig.hpp"
#include "simulation/simulate.hpp"
#include "view_pairs.hpp"

namespace turbomap::extraction {

/// What was found in the images of a keyframe. Keypoints of the left camera first.
struct keyframe_features {
  image_features features;
  std::vector<std::int32_t> stereo_partner;  ///< of a fisheye pair
  /// What the keypoints show, in the left camera; not in front of it where that is not known.
  std::vector<Eigen::Vector3d> point;
};

struct point_tracker_options {
  int keyframes = 10;  ///< a point is looked for until it was not seen in so many
  /// px, times the scale of the keypoint's level: poses are true or drift by some mm between keyframes; a stereo point 3 m
  /// off may be 2 px off in the next.
  double window = 6;
  std::uint32_t most_different = 50;  ///< bits of 256 [ORB-SLAM3]
  int octaves = 2;                    ///< a keypoint is so many levels from the last one at most
};

class point_tracker {
 public:
  point_tracker(const simulation::simulated_rig& rig, float scale_factor, const point_tracker_options& options)
      : rig_(rig), factor_(scale_factor), options_(options) {}

  /// The associations of keyframe i, in the order of its keypoints. T_wc: of the left camera, as it is recorded.
  std::vector<point_association> track(std::int32_t i, const keyframe_features& seen, const Eigen::Isometry3d& T_wc) {
    held_.assign(seen.features.keypoints.size(), -1);
    for (const keypoint& z : seen.features.keypoints)
      while (reach_.size() <= z.octave)
        reach_.push_back(options_.window * std::pow(static_cast<double>(factor_), static_cast<double>(reach_.size())));
    find_again(i, seen, T_wc);
    const std::vector<std::int32_t> found = held_;
    create(i, seen, T_wc);
    std::vector<point_association> out;
    for (std::size_t k = 0; k < held_.size(); ++k) {
      if (held_[k] < 0) continue;
      const tracked_point& p = points_[static_cast<std::size_t>(held_[k])];
      point_association a;
      a.keypoint = static_cast<std::int32_t>(k), a.is_new = found[k] < 0, a.position = simulation::to_float(p.position);
      a.latest = p.last, a.earliest = p.first;
      out.push_back(a);
    }
    for (std::size_t k = 0; k < held_.size(); ++k)
      if (found[k] >= 0) observed(i, k, seen, points_[static_cast<std::size_t>(found[k])]);
    return out;
  }

  /// A keyframe with the pose that is recorded.
  struct posed_features {
    std::int32_t keyframe;
    const keyframe_features& seen;
    const Eigen::Isometry3d& T_wc;
  };
  /// Points that mapping makes of one camera's keyframe and the one before, of keypoints that have none: later keyframes see
  /// them. \param held_before  as held() was after the one before
  void map_pairs(const posed_features& before, const std::vector<std::int32_t>& held_before, const posed_features& now,
                 const view_pair_options& options) {
    const auto pairs =
        view_pairs({before.seen.features, rig_.cameras[0], &held_before}, {now.seen.features, rig_.cameras[0], &held_},
                   before.T_wc.inverse() * now.T_wc, factor_, options);
    for (const view_pair& pair : pairs) {
      tracked_point p;
      p.position = before.T_wc * pair.point;
      p.first = {before.keyframe, pair.a};
      observed(now.keyframe, static_cast<std::size_t>(pair.b), now.seen, p);
      held_[static_cast<std::size_t>(pair.b)] = static_cast<std::int32_t>(points_.size());
      points_.push_back(p);
    }
  }
  /// The point of every keypoint of the last keyframe, -1: none.
  const std::vector<std::int32_t>& held() const { return held_; }

 private:
  struct tracked_point {
    Eigen::Vector3d position;
    keypoint_reference first, last;
    descriptor_bytes descriptor{};
    int octave = 0;
  };
  struct candidate {
    std::uint32_t distance;
    std::int32_t point;
    std::size_t keypoint;
  };

  static void observed(std::int32_t i, std::size_t k, const keyframe_features& seen, tracked_point& p) {
    p.last = {i, static_cast<std::int32_t>(k)};
    if (p.first.keyframe < 0) p.first = p.last;
    p.descriptor = seen.features.descriptors[k], p.octave = seen.features.keypoints[k].octave;
  }

  /// Each keypoint shows one point, each point is at one keypoint of a camera: the nearest descriptors first.
  void find_again(std::int32_t i, const keyframe_features& seen, const Eigen::Isometry3d& T_wc) {
    std::vector<candidate> candidates;
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      const Eigen::Isometry3d T_cw = (T_wc * rig_.cameras[0].T_bc.inverse() * rig_.cameras[c].T_bc).inverse();
      for (std::size_t p = 0; p < points_.size(); ++p) {
        if (points_[p].last.keyframe < i - options_.keyframes) continue;
        Eigen::Vector2d pixel;
        if (!rig_.cameras[c].project(T_cw * points_[p].position, pixel)) continue;
        look_around(pixel, static_cast<std::uint8_t>(c), static_cast<std::int32_t>(p), seen, candidates);
      }
    }
    std::sort(candidates.begin(), candidates.end(), [](const candidate& x, const candidate& y) {
      return x.distance != y.distance ? x.distance < y.distance
             : x.point != y.point     ? x.point < y.point
                                      : x.keypoint < y.keypoint;
    });
    std::vector<std::uint8_t> placed(points_.size(), 0);  // a bit for each camera
    for (const candidate& c : candidates) {
      const auto p = static_cast<std::size_t>(c.point);
      const auto bit = static_cast<std::uint8_t>(1 << seen.features.keypoints[c.keypoint].camera);
      if (held_[c.keypoint] >= 0 || (placed[p] & bit) != 0) continue;
      held_[c.keypoint] = c.point, placed[p] = static_cast<std::uint8_t>(placed[p] | bit);
    }
  }
  void look_around(const Eigen::Vector2d& pixel, std::uint8_t camera, std::int32_t p, const keyframe_features& seen,
                   std::vector<candidate>& candidates) const {
    const tracked_point& point = points_[static_cast<std::size_t>(p)];
    for (std::size_t k = 0; k < held_.size(); ++k) {
      const keypoint& z = seen.features.keypoints[k];
      if (z.camera != camera || std::abs(z.octave - point.octave) > options_.octaves) continue;
      const double reach = reach_[z.octave];
      if (std::abs(z.x - pixel.x()) > reach || std::abs(z.y - pixel.y()) > reach) continue;
      const std::uint32_t d = simulation::hamming(point.descriptor, seen.features.descriptors[k]);
      if (d <= options_.most_different) candidates.push_back({d, p, k});
    }
  }

  /// New points of keypoints with a known, close depth; both keypoints of a fisheye pair show the same one.
  void create(std::int32_t i, const keyframe_features& seen, const Eigen::Isometry3d& T_wc) {
    for (std::size_t k = 0; k < held_.size(); ++k) {
      const keypoint& z = seen.features.keypoints[k];
      const double depth = seen.point[k].z();
      const std::int32_t partner = seen.stereo_partner.empty() ? -1 : seen.stereo_partner[k];
      if (held_[k] >= 0 || z.camera != 0 || !(depth > 0)) continue;
      if (rig_.baseline > 0 && depth > rig_.close_depth) continue;
      if (partner >= 0 && held_[static_cast<std::size_t>(partner)] >= 0)
        continue;  // an old point that the left eye missed
      tracked_point p;
      p.position = T_wc * seen.point[k];
      observed(i, k, seen, p);
      held_[k] = static_cast<std::int32_t>(points_.size());
      if (partner >= 0) held_[static_cast<std::size_t>(partner)] = held_[k];
      points_.push_back(p);
    }
  }

  const simulation::simulated_rig& rig_;
  float factor_;
  point_tracker_options options_;
  std::vector<double> reach_;  ///< px, by octave: how far from its projection a point is looked for
  std::vector<tracked_point> points_;
  std::vector<std::int32_t> held_;
};

}  // namespace turbomap::extraction
