// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A search by projection in the memory of its policy: everything its kernels read and write, as plain pointers.

#include <cstddef>
#include <cstdint>

#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "projection_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One camera of one target as the caller gave it.
struct projection_request {
  std::int32_t target;        ///< index of the target
  std::int32_t camera;        ///< of the target's rig
  const std::uint8_t* skip;   ///< of every point; null: none is skipped
  const std::uint8_t* taken;  ///< of every keypoint of the target; null: none is
  std::uint64_t* claims;      ///< on every keypoint of the target; null: several points may match one
};

/// The same, ready to project points.
struct projection_camera {
  isometry<decision> T_cw;  ///< world to this camera
  vec3<decision> centre;    ///< world
  decision bf;              ///< px m; 0: no u_right (curved images have none)
  projection_request of;    ///< what the caller gave
};

/// The keypoint that a point matched; -1: none.
template <class Distance>
struct projection_hit {
  std::int32_t keypoint;  ///< matched keypoint of the target; -1: none
  Distance distance;      ///< of the descriptors
};

/// Views of one search. `request` numbers the cameras of all targets, target by target; results are [request][point].
template <class Descriptor, class Camera>
struct projection_view {
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  const keyframe_view<Descriptor, Camera>* keyframes;  ///< [target]
  const rigid_transform<double>* T_cw;                 ///< [target]
  const projection_request* requests;                  ///< request_count
  map_point_view<Descriptor> points;                   ///< in the memory of the policy
  const float* scale;                                  ///< scale_factor^o
  const float* sigma2;                                 ///< scale_factor^(2 o), px^2
  projection_camera* cameras;                          ///< request_count
  projection_hit<distance_type>* hits;                 ///< [request][point]
  projection_trial<distance_type>* trials;             ///< [request][point]; null: not kept
  std::uint64_t* claims;                               ///< claim_count: on the keypoints of all targets
  std::size_t claim_count;                             ///< 0 without options.one_to_one
  int request_count;                                   ///< cameras of all targets
  distance_type max_distance;                          ///< largest distance of a match
  float min_range_factor;                              ///< times the least distance of a point
  float max_range_factor;                              ///< times the largest distance of a point
  projection_options options;                          ///< thresholds

  /// The first element of a point's descriptor.
  TURBOMAP_HD const typename Descriptor::element* descriptor_of(int point) const {
    return points.descriptor + static_cast<std::size_t>(point) * Descriptor::elements;
  }
  /// The covariance of a point; null where it is exact.
  TURBOMAP_HD const point_covariance* covariance_of(int point) const {
    if (points.covariance == nullptr) return nullptr;
    const point_covariance& c = points.covariance[point];
    const bool exact = c.xx == 0 && c.yx == 0 && c.yy == 0 && c.zx == 0 && c.zy == 0 && c.zz == 0;
    return exact ? nullptr : &c;
  }
  /// The least distance at which a point is looked for, m: its own times the factor, rounded to float as the recorded one is.
  TURBOMAP_HD float least_distance(int point) const {
    return (strict<float>(min_range_factor) * strict<float>(points.min_distance[point])).value;
  }
  /// The largest distance at which it is looked for, m, in the same way.
  TURBOMAP_HD float largest_distance(int point) const {
    return (strict<float>(max_range_factor) * strict<float>(points.max_distance[point])).value;
  }
};

TURBOMAP_END_NAMESPACE
