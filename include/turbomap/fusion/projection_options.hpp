// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a search by projection takes and gives, as plain data: options, map points, the frames in which they are looked for,
/// the plan, the trials.

#include <cstdint>

#include "../config.hpp"
#include "../descriptor/binary.hpp"
#include "../span.hpp"
#include "../store/keyframe_view.hpp"
#include "../types.hpp"

namespace turbomap {

/// Which points have to fit a keypoint's pixel beyond lying in the window. The fit is e^T W e <= mono_chi2, or stereo_chi2
/// with u_right; e the differences of keypoint and projection, W = (sigma^2 I + J Sigma J^T)^-1 with the point's covariance
/// Sigma, 1 / sigma^2 for a point that is exact.
enum class projection_gate : std::uint8_t {
  none,       ///< none: the pose of the frame is a rough guess
  uncertain,  ///< those that come with a covariance: how far off they may be is known
  all,        ///< every point
};

/// Options of search_by_projection(). Defaults are those of [ORB-SLAM3]'s search of the local map.
struct projection_options {
  /// Of the keypoints.
  pyramid scales;
  double radius = 2.5;            ///< px at octave 0, grows with s^o: half the side of the square window
  double oblique_cosine = 0.998;  ///< of viewing ray and normal: a point seen at less than that ...
  double oblique_factor = 1.6;    ///< ... has a window so many times larger, 4 px. 1: no difference is made
  double min_view_cosine = 0.5;   ///< of viewing ray and normal: 60 degrees. -1: any; normals may then be null where
                                  ///< oblique_factor is 1
  double min_range_factor = 0.8;  ///< a point is looked for from min_range_factor * min_distance ...
  double max_range_factor = 1.2;  ///< ... to max_range_factor * max_distance (both products in float)
  bool range_gate = true;   ///< false: the distance range neither gates nor predicts the octave (ranges may be null),
                            ///< every octave is a candidate, the window is that of window_octave
  int window_octave = 0;    ///< without range_gate; in [0, levels)
  int finer_octaves = 1;    ///< candidates are keypoints from so many octaves below the predicted one ...
  int coarser_octaves = 0;  ///< ... to so many above
  /// Which points must fit the pixel.
  projection_gate gate = projection_gate::uncertain;
  double mono_chi2 = 5.991;       ///< 95 %, 2 dof
  double stereo_chi2 = 7.815;     ///< 95 %, 3 dof
  double stereo_correlation = 0;  ///< of the errors of u and u_right, for points with a covariance: see reprojections
  double window_sigmas = 3;  ///< the window of a point with a covariance holds the ellipse of so many sigma, if that is
                             ///< larger (99.7 % per axis); 0: never
  double max_radius = 40;    ///< px; no window gets larger than this by a covariance: 4 cells, for the cost
  double max_distance = 100;  ///< largest descriptor distance of a match (100 of 256 bits: TH_HIGH)
  double max_ratio = 1;       ///< the best distance is at most so much of the second best in the window; 1: no test
  bool one_to_one = true;     ///< a keypoint goes to the point of least (distance, index); the others go without
  bool keep_trials = false;   ///< keep the outcome of every (target, camera, point), not only the matches

  /// Whether map_point_view::normal is read.
  TURBOMAP_HD constexpr bool reads_normals() const { return min_view_cosine > -1 || oblique_factor != 1; }
  /// \param uncertain  the point has a covariance
  TURBOMAP_HD constexpr bool is_gated(bool uncertain) const {
    return gate == projection_gate::all || (gate == projection_gate::uncertain && uncertain);
  }
  /// \param predicted  octave of the point
  TURBOMAP_HD constexpr bool is_candidate(int octave, int predicted) const {
    return octave - predicted <= coarser_octaves && predicted - octave <= finer_octaves;
  }
};

/// What became of one point in one camera of one target. The tests come in the order skipped, behind ...
/// no_consistent_keypoint, too_different, ambiguous, lost; the numbers up to 9 are those of the recordings.
enum class projection_outcome : std::uint16_t {  // 16 bits: a trial has no bytes that nobody writes
  matched = 0,
  too_different = 1,           ///< the best keypoint is farther than max_distance
  skipped = 3,                 ///< the caller said so
  behind = 4,                  ///< depth <= 0; also a position or covariance that is not finite
  outside = 5,                 ///< of the image, or where the camera model is not defined
  out_of_range = 6,            ///< distance to the camera; also a range that is not finite
  oblique = 7,                 ///< seen too far off its normal; also a normal that is not finite
  no_keypoint = 8,             ///< none in the window
  no_consistent_keypoint = 9,  ///< none of those in the window is free and has the octave and the reprojection error
  ambiguous = 10,              ///< the second best keypoint is nearly as similar: max_ratio
  lost = 11,                   ///< a more similar point has the keypoint: one_to_one
};

/// Map points in host memory, one array per field.
template <class Descriptor>
struct map_point_view {
  int count = 0;                           ///< of points
  const vec3<double>* position = nullptr;  ///< count; world, m
  const vec3<float>* normal = nullptr;     ///< count; mean of the unit rays camera -> point, world, not normalised
  const float* min_distance = nullptr;  ///< count; m, the range in which the pyramid sees the point, before any factor
  const float* max_distance = nullptr;  ///< count
  const typename Descriptor::element* descriptor = nullptr;  ///< count * Descriptor::elements
  const point_covariance* covariance = nullptr;              ///< count; how well positions are known. Null: exact
};

/// A frame or keyframe in which the points are looked for.
template <class Descriptor, class Camera>
struct projection_target {
  keyframe_view<Descriptor, Camera> view;  ///< in the memory of the policy
  rigid_transform<double> T_cw;            ///< world to camera (to body for a rig with T_camera_body)
  /// In host memory, [camera][point]; not 0: the point is observed in that camera already, or not to be looked for. Empty:
  /// none is.
  span<const std::uint8_t> skip = {};
  /// In host memory, [keypoint]; not 0: the keypoint holds a point already and is no candidate. Empty: all are.
  span<const std::uint8_t> taken = {};
};

/// One match: point `point` looks like keypoint `keypoint`, which camera `camera` of target number `target` saw.
template <class Distance>
struct projection_match {
  std::int32_t target;    ///< number among the targets
  std::int32_t camera;    ///< of the target
  std::int32_t point;     ///< number in the map_point_view
  std::int32_t keypoint;  ///< of the target
  Distance distance;      ///< of the descriptors
};

/// One point in one camera of one target: the full story.
template <class Distance>
struct projection_trial {
  /// Where it ended.
  projection_outcome outcome;
  std::int16_t level;     ///< predicted octave; -1: not predicted (rejected before, or without range_gate)
  std::int32_t keypoint;  ///< the best one, also where too_different; -1: none
  Distance distance;      ///< its distance; without a keypoint no_match_distance
};

/// The distance of a trial without a keypoint: what the recorded system reports, as many bits as a binary descriptor
/// has; of any other descriptor the worst there is.
template <class Descriptor>
inline constexpr typename Descriptor::distance_type no_match_distance = Descriptor::worst;
/// Of binary descriptors.
template <int Bits>
inline constexpr std::int32_t no_match_distance<binary_descriptor<Bits>> = Bits;

/// True where options.one_to_one is possible: claims hold distances of 32 bits (claim.hpp).
template <class Descriptor>
inline constexpr bool can_claim = sizeof(typename Descriptor::distance_type) == 4;

}  // namespace turbomap
