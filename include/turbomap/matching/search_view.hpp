// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A correspondence search in the memory of its policy: everything that kernels, filters and point creation read, as plain
/// pointers.

#include <cstdint>

#include "../config.hpp"
#include "epipolar.hpp"
#include "search_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// No candidate passed.
inline constexpr std::int32_t no_match = -1;

/// Calls f(i) for begin <= i < end where result i is a match, in this order. On the host: few are, so many are passed over at once.
template <class F>
void for_each_match(const std::int32_t* match, int begin, int end, const F& f) {
  static_assert(no_match == -1, "all bits are set");
  constexpr int many = 32;
  int i = begin;
  for (; end - i >= many; i += many) {
    std::int32_t all = no_match;
    for (int n = 0; n < many; ++n) all &= match[i + n];
    for (int n = 0; all != no_match && n < many; ++n)
      if (match[i + n] != no_match) f(i + n);
  }
  for (; i < end; ++i)
    if (match[i] != no_match) f(i);
}

/// Views of one search. Keyframe 0 is the query, keyframe 1 + n is neighbour n. `slot` numbers the query keypoints that hold
/// no map point; results are [neighbour][slot].
template <class Descriptor, class Camera>
struct search_view {
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  const keyframe_view<Descriptor, Camera>* keyframes;  ///< 1 + neighbour_count
  const rigid_transform<double>* T_cw;                 ///< 1 + neighbour_count
  const std::uint8_t* has_point;                       ///< of all neighbours, one after the other
  const std::int32_t* has_point_offset;                ///< neighbour_count
  const std::int32_t* candidate_begin;                 ///< neighbour_count: of each neighbour in `candidates`
  std::int32_t* candidate_end;                         ///< neighbour_count: behind its last one
  std::int32_t* candidates;                            ///< its keypoints without a map point, ascending
  const std::int32_t* queries;                         ///< slot_count keypoints of the query, ascending
  const float* scale;                                  ///< scale_factor^o
  const float* sigma2;                                 ///< scale_factor^(2 o)
  pair_geometry* pairs;                                ///< [neighbour][query camera][neighbour camera]
  std::int32_t* match;                                 ///< [neighbour][slot]: candidate keypoint or no_match
  distance_type* distance;                             ///< [neighbour][slot]: its descriptor distance
  int neighbour_count;                                 ///< neighbours
  int slot_count;                                      ///< query keypoints without a map point
  int query_cameras;                                   ///< cameras of the query's rig
  int neighbour_cameras;                               ///< the most of any neighbour
  int own_neighbour;           ///< the number under which the query is its own neighbour; -1: it is not
  distance_type max_distance;  ///< largest distance of a match
  search_options options;      ///< thresholds

  /// The keyframe whose keypoints are searched for.
  TURBOMAP_HD const keyframe_view<Descriptor, Camera>& query() const { return keyframes[0]; }
  /// Neighbour n (not checked).
  TURBOMAP_HD const keyframe_view<Descriptor, Camera>& neighbour(int n) const { return keyframes[1 + n]; }
  /// Whether two cameras are compared: of the query with itself, different ones only.
  TURBOMAP_HD bool compares(int n, int query_camera, int neighbour_camera) const {
    return n != own_neighbour || query_camera != neighbour_camera;
  }
  /// The geometry of a query camera and a neighbour camera.
  TURBOMAP_HD pair_geometry& pair(int n, int query_camera, int neighbour_camera) const {
    return pairs[(n * query_cameras + query_camera) * neighbour_cameras + neighbour_camera];
  }
};

TURBOMAP_END_NAMESPACE
