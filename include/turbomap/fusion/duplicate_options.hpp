// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a duplicate search takes and gives, as plain data: options, map points, target keyframes, the plan, the trials.

#include <cstdint>

#include "../descriptor/binary.hpp"
#include "../span.hpp"
#include "../store/keyframe_view.hpp"
#include "../types.hpp"

namespace turbomap {

/// Options of find_duplicates(). Defaults are those of [ORB-SLAM3] and [TurboMap §IV-D].
struct duplicate_options {
  pyramid scales;                 ///< sigma2(o) = scale_factor^(2 o) px^2
  double radius = 3;              ///< px at octave 0, grows with s^o: half the side of the square window
  double min_view_cosine = 0.5;   ///< of viewing ray and normal: 60 degrees. -1: any; normals may then be null
  double min_range_factor = 0.8;  ///< a point is looked for from min_range_factor * min_distance ...
  double max_range_factor = 1.2;  ///< ... to max_range_factor * max_distance (both products in float)
  double mono_chi2 = 5.99;        ///< gate of reprojection error^2 / sigma2, two residuals: 95 %, 2 dof
  double stereo_chi2 = 7.8;       ///< the same with u_right, three residuals: 95 %, 3 dof
  double max_distance = 50;       ///< largest descriptor distance of a duplicate (50 of 256 bits: TH_LOW)
  bool range_gate = true;    ///< false: the distance range neither gates nor predicts the octave (ranges may be null),
                             ///< every octave is a candidate, the window is that of window_octave
  int window_octave = 0;     ///< without range_gate; in [0, levels)
  bool keep_trials = false;  ///< keep the outcome of every (target, camera, point), not only the matches
};

/// What became of one point in one camera of one target. The tests come in the order skipped, behind ...
/// no_consistent_keypoint, too_different; the numbers are those of the recordings.
enum class duplicate_outcome : std::uint16_t {  // 16 bits: a trial has no bytes that nobody writes
  matched = 0,
  too_different = 1,           ///< the best keypoint is farther than max_distance
  skipped = 3,                 ///< the caller said so
  behind = 4,                  ///< depth <= 0; also a position that is not finite
  outside = 5,                 ///< of the image, or where the camera model is not defined
  out_of_range = 6,            ///< distance to the camera; also a range that is not finite
  oblique = 7,                 ///< seen too far off its normal; also a normal that is not finite
  no_keypoint = 8,             ///< none in the window
  no_consistent_keypoint = 9,  ///< none of those in the window has the octave and the reprojection error
};

/// Map points in host memory, one array per field.
template <class Descriptor>
struct map_point_view {
  int count = 0;
  const vec3<double>* position = nullptr;  ///< count; world, m
  const vec3<float>* normal = nullptr;     ///< count; mean of the unit rays camera -> point, world, not normalised
  const float* min_distance = nullptr;  ///< count; m, the range in which the pyramid sees the point, before any factor
  const float* max_distance = nullptr;  ///< count
  const typename Descriptor::element* descriptor = nullptr;  ///< count * Descriptor::elements
};

/// A keyframe in which the points are looked for.
template <class Descriptor, class Camera>
struct duplicate_target {
  keyframe_view<Descriptor, Camera> view;
  rigid_transform<double> T_cw;  ///< world to camera (to body for a rig with T_camera_body)
  /// In host memory, [camera][point]; not 0: the point is observed in that camera already, or not to be looked for. Empty:
  /// none is.
  span<const std::uint8_t> skip = {};
};

/// One match: point `point` looks like keypoint `keypoint`, which camera `camera` of target number `target` saw.
template <class Distance>
struct duplicate {
  std::int32_t target;
  std::int32_t camera;
  std::int32_t point;
  std::int32_t keypoint;
  Distance distance;
};

/// One point in one camera of one target: the full story.
template <class Distance>
struct duplicate_trial {
  duplicate_outcome outcome;
  std::int16_t level;     ///< predicted octave; -1: not predicted (rejected before, or without range_gate)
  std::int32_t keypoint;  ///< the best one, also where too_different; -1: none
  Distance distance;      ///< its distance; without a keypoint no_duplicate_distance
};

/// The distance of a trial without a keypoint: what the recorded system reports, as many bits as a binary descriptor
/// has; of any other descriptor the worst there is.
template <class Descriptor>
inline constexpr typename Descriptor::distance_type no_duplicate_distance = Descriptor::worst;
template <int Bits>
inline constexpr std::int32_t no_duplicate_distance<binary_descriptor<Bits>> = Bits;

}  // namespace turbomap
