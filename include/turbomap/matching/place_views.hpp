// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracks in the memory of their policy, as creation reads them: where each camera stands, and room for the ray of each view in
/// the world, which whoever makes a track's point computes once.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "create_point.hpp"
#include "track_joiner.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A camera of a keyframe of the search in the world.
struct placed_camera {
  isometry<decision> T_cw;
  vec3<decision> centre;
};
/// A view of a track as creation sees it.
struct placed_view {
  creation_view seen;
  vec3<decision> direction;  ///< of its ray in the world, unit
};

}  // namespace detail

/// The tracks of one call in the memory of the policy.
template <class Descriptor, class Camera>
struct track_creation_view {
  search_view<Descriptor, Camera> search;  ///< keyframes and cameras
  creation_options options;                ///< thresholds
  const std::int32_t* offsets;             ///< track_count + 1
  const track_view* views;                 ///< of all tracks
  const std::int32_t* map_points;        ///< number of the map point at each keypoint of all keyframes, -1: none; null:
                                         ///< nobody knows
  const std::int32_t* map_point_offset;  ///< of each keyframe
  int track_count;                       ///< tracks
  int cameras;                           ///< the most of any keyframe
  detail::placed_camera* placed_cameras;  ///< [keyframe][camera]
  detail::placed_view* placed_views;      ///< of each view of a track that is looked at
  std::uint8_t* kept;                     ///< of each view: whether its track's point is seen there
  created_track* points;                  ///< of each track
};

/// Whether two keypoints of a keyframe may be of one corner: detectors find it in several octaves. options.known_chi2
template <class Descriptor, class Camera>
TURBOMAP_HD bool are_beside(const track_creation_view<Descriptor, Camera>& tracks,
                            const keyframe_view<Descriptor, Camera>& keyframe, int a, int b) {
  const auto p = cast<decision>(keyframe.pixel[a]), q = cast<decision>(keyframe.pixel[b]);
  const decision dx = p.x - q.x, dy = p.y - q.y;
  const float* sigma2 = tracks.search.sigma2;
  const decision both = decision(sigma2[keyframe.octave[a]]) + decision(sigma2[keyframe.octave[b]]);
  return dx * dx + dy * dy <= decision(tracks.options.known_chi2) * both;
}

/// Index = keyframe * cameras + camera.
template <class Descriptor, class Camera>
struct place_camera {
  track_creation_view<Descriptor, Camera> tracks;  ///< what is read and written

  /// Places camera i.
  TURBOMAP_HD void operator()(int i) const {
    const int k = i / tracks.cameras, c = i % tracks.cameras;
    const auto& keyframe = tracks.search.keyframes[k];
    if (c >= keyframe.camera_count) return;  // a rig with fewer cameras than another one
    const isometry<decision> T = camera_pose(keyframe.cameras[c], tracks.search.T_cw[k]);
    tracks.placed_cameras[i] = {T, camera_centre(T)};
  }
};

/// Poses of all cameras.
template <class Derived, class Descriptor, class Camera>
void launch_place_cameras(const thrust::execution_policy<Derived>& policy,
                          const track_creation_view<Descriptor, Camera>& tracks) {
  for_each_index(derived(policy), (1 + tracks.search.neighbour_count) * tracks.cameras,
                 place_camera<Descriptor, Camera>{tracks});
}

TURBOMAP_END_NAMESPACE
