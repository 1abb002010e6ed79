// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What update_appearance() takes and gives, as plain data.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../span.hpp"
#include "../types.hpp"

namespace turbomap {

/// One view of a point: a keypoint of a keyframe of the call. A rig that sees the point with two cameras gives two.
struct point_observation {
  std::int32_t keyframe;  ///< index into the call's keyframes
  std::int32_t keypoint;  ///< keypoint index, within the keyframe
};

/// The points to be updated, in host memory; read during the call only.
struct appearance_view {
  int count = 0;                                     ///< points
  const vec3<double>* position = nullptr;            ///< count; world, m. Not needed without geometry
  const std::int32_t* observation_offset = nullptr;  ///< count + 1, from 0, ascending
  const point_observation* observations = nullptr;   ///< in the order that decides ties: the first wins
  const std::int32_t* reference = nullptr;           ///< count; reference keyframe of each point, an index into the
                                                     ///< call's keyframes: one of its observers. Not needed without
                                                     ///< geometry, nor read for a point without observations
};

/// Options of update_appearance().
struct appearance_options {
  pyramid scales;           ///< its distances follow the octave of the reference observation
  bool descriptors = true;  ///< choose representative descriptors
  bool geometry = true;     ///< compute normals and distance ranges
  bool covariance = false;  ///< compute how well positions are known, from the pixels of all views; needs geometry
  double stereo_correlation = 0;  ///< for that: of the errors of u and u_right, in [0, 1)
  /// Of a point with n > most_views views, these stand for all in the choice of the descriptor and in the mean of the rays: the
  /// views floor(j n / most_views), j = 0 ... most_views - 1, in the order of the call. 0: all take part, as in [ORB-SLAM3]; the
  /// cost is quadratic. The default is measured: docs/performance.md, Growth.
  int most_views = 128;
};

/// What a point is after its observations or its position have changed. Without observations everything is 0.
struct point_appearance {
  vec3<float> normal;  ///< mean of the unit rays from the centre of every observing camera to the point, as it comes:
                       ///< shorter than 1, the more the rays differ
  float min_distance;  ///< m from the camera at which the pyramid still sees the point: max_distance / s^(levels - 1)
  float max_distance;  ///< m; distance to the reference keyframe * s^octave
  /// The observation with the representative descriptor, counted from the point's first; -1: none.
  std::int32_t medoid;
  /// All 0: not asked for. Poses of the keyframes are taken as exact. Where the views leave the distance open, it is the
  /// point's distance from the farthest camera, as one standard deviation.
  point_covariance covariance = {};
};

/// Appearances as update_appearance() gives them, by number of the point.
template <class Descriptor>
struct computed_appearances {
  span<const point_appearance> points;                   ///< one per point
  span<const typename Descriptor::element> descriptors;  ///< [point][element]

  /// Whether there are no points.
  bool empty() const { return points.empty(); }
  /// Number of points.
  std::size_t size() const { return points.size(); }
  /// The descriptor of point i (not checked).
  const typename Descriptor::element* descriptor(std::size_t i) const {
    return descriptors.data() + i * static_cast<std::size_t>(Descriptor::elements);
  }
};

}  // namespace turbomap
