// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A duplicate search in the memory of its policy: everything its kernels read and write, as plain pointers.

#include <cstdint>

#include "../camera/camera_concept.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "duplicate_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One camera of one target as the caller gave it.
struct duplicate_request {
  std::int32_t target;
  std::int32_t camera;
  const std::uint8_t* skip;  ///< of every point; null: none is skipped
};

/// The same, ready to project points.
struct duplicate_camera {
  isometry<decision> T_cw;  ///< world to this camera
  vec3<decision> centre;    ///< world
  decision bf;              ///< px m; 0: no u_right (curved images have none)
  duplicate_request of;
};

/// The keypoint that a point matched; -1: none.
template <class Distance>
struct duplicate_hit {
  std::int32_t keypoint;
  Distance distance;
};

/// Views of one search. `request` numbers the cameras of all targets, target by target; results are [request][point].
template <class Descriptor, class Camera>
struct duplicate_view {
  using distance_type = typename Descriptor::distance_type;

  const keyframe_view<Descriptor, Camera>* keyframes;  ///< target_count
  const rigid_transform<double>* T_cw;                 ///< target_count
  const duplicate_request* requests;                   ///< request_count
  map_point_view<Descriptor> points;                   ///< in the memory of the policy
  const float* scale;                                  ///< scale_factor^o
  const float* sigma2;                                 ///< scale_factor^(2 o), px^2
  duplicate_camera* cameras;                           ///< request_count
  duplicate_hit<distance_type>* hits;                  ///< [request][point]
  duplicate_trial<distance_type>* trials;              ///< [request][point]; null: not kept
  int target_count;
  int request_count;
  distance_type max_distance;
  float min_range_factor, max_range_factor;
  duplicate_options options;

  TURBOMAP_HD const typename Descriptor::element* descriptor_of(int point) const {
    return points.descriptor + static_cast<std::size_t>(point) * Descriptor::elements;
  }
  /// The range in which a point is looked for: its own times the factors, rounded to float as the recorded one is.
  TURBOMAP_HD float least_distance(int point) const {
    return (strict<float>(min_range_factor) * strict<float>(points.min_distance[point])).value;
  }
  TURBOMAP_HD float largest_distance(int point) const {
    return (strict<float>(max_range_factor) * strict<float>(points.max_distance[point])).value;
  }
};

TURBOMAP_END_NAMESPACE
