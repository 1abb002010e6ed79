// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What map point creation takes and gives, as plain data: options, reasons, the plan.

#include <cstddef>
#include <cstdint>

#include "../span.hpp"
#include "../types.hpp"

namespace turbomap {

/// Why a match did or did not become a map point candidate, in the order of the tests.
enum class creation_outcome : std::uint16_t {  // 16 bits: results have no bytes that nobody writes
  accepted = 0,
  low_parallax = 1,            ///< rays too close to parallel, and no stereo depth to fall back on
  at_infinity = 2,             ///< the triangulated point has no finite position; tracks: or no finite covariance
  no_depth = 3,                ///< low_parallax, with a stereo keypoint that has no positive depth
  behind_query = 4,            ///< not in front of the query camera
  behind_neighbour = 5,        ///< not in front of the neighbour camera
  reprojection_query = 6,      ///< reprojection error in the query above the gate
  reprojection_neighbour = 7,  ///< reprojection error in the neighbour above the gate
  zero_distance = 8,           ///< the point coincides with a camera centre
  too_far = 9,                 ///< farther than options.max_distance
  scale = 10,                  ///< the ratio of distances contradicts the ratio of octaves
  known = 11,                  ///< tracks: the map has a point of this landmark already
  too_few_keyframes = 12,      ///< tracks: options.fewest_keyframes
  lookalike = 13               ///< tracks: options.lookalike_ratio
};

/// Where the position of a point came from.
enum class creation_method : std::int16_t { none = -1, triangulated = 0, stereo_query = 1, stereo_neighbour = 2 };

/// What points are made from.
enum class creation_rule : std::uint8_t {
  pairs,  ///< each match: one point per pair of views; fusion merges those of one landmark [ORB-SLAM3]
  tracks  ///< all matches of one landmark together: one point with all its views
};

/// Options of create_points() and create_track_points(). Defaults are those of [ORB-SLAM3] where it has them.
struct creation_options {
  creation_rule rule = creation_rule::tracks;  ///< of the stage; each of the two functions has its own
  /// Of the keypoints.
  pyramid scales;
  double max_parallax_cosine = 0.9998;  ///< monocular matches need more parallax than this; 0.9996 in inertial systems
  double mono_chi2 = 5.991;             ///< gate of reprojection error^2 / sigma2, 95 %, 2 dof
  double stereo_chi2 = 7.8;             ///< the same with u_right, 95 %, 3 dof
  double scale_tolerance = 1.5;         ///< distance and octave ratios agree within this times scale_factor
  double max_distance = 0;              ///< m from every camera; 0: no limit
  /// Tracks: most Gauss-Newton steps on the reprojection errors. Two are enough nearly always.
  int refinement_steps = 4;
  /// Tracks: no further step where it promises to lower the sum of squared errors / sigma2 by less than this: 1e-3 moves
  /// a point by 3 % of its standard deviation.
  double refinement_tolerance = 1e-3;
  /// Tracks: detectors find one corner in several octaves, and a camera sees a point at one of them only. A track is of a
  /// known landmark if in so many of its views a keypoint beside it sees the same point of the map; 0: nobody asks.
  int known_views = 2;
  /// Beside: squared distance <= this (sigma2 of one + sigma2 of the other): 95 %, 2 dof, as merge_tolerance. For
  /// lookalike_ratio too: what is beside a match is the same corner.
  double known_chi2 = 5.991;
  /// Beside: of octaves that differ by so many at most, finer or coarser; 255: of any. 1 was chosen by measurement
  /// (docs/evaluation.md). Keypoints of one corner that are farther apart are two points, whose errors are their own. Fusion would
  /// rarely find one at the other: it looks at the octave that it predicts and one finer, where this rule predicts none.
  int known_octaves = 1;
  /// Tracks: a point is seen by so many keyframes at least. 1: the cameras of one rig suffice, which gives the most exact
  /// trajectories. 2 where things look alike side by side, and lookalike_ratio is not enough. Measured: docs/matching.md.
  int fewest_keyframes = 1;
  /// Tracks, a ratio test [Lowe]: where two cameras of one keyframe are all that is left, their descriptors must be nearer than so
  /// many times those of either keypoint and any other that the other camera may see its landmark at; 0: nobody asks. 0.8: as
  /// ratio_test. What looks alike side by side has no third view that contradicts. Measured: docs/matching.md.
  double lookalike_ratio = 0.8;
  double stereo_correlation = 0;  ///< tracks: of the errors of u and u_right, in [0, 1); weighs rows of u_right
};

/// One match of the search with what became of it.
struct created_point {
  std::int32_t neighbour;    ///< number of the neighbour
  std::int32_t query;        ///< keypoint of the query
  std::int32_t candidate;    ///< keypoint of the neighbour
  creation_outcome outcome;  ///< accepted, or why not
  creation_method method;    ///< where the position comes from
  vec3<double> position;     ///< world, m; meaningful once a method is named
};
static_assert(sizeof(created_point) ==
                  3 * sizeof(std::int32_t) + sizeof(creation_outcome) + sizeof(creation_method) + sizeof(vec3<double>),
              "no padding: a memory checker would find it in the copy from a device");

/// Which points of the map the keypoints of a search see, on the host: for known landmarks.
struct known_points {
  span<const std::int32_t>
      numbers;  ///< by keypoint of one keyframe after the other, the query first; equal numbers: one
                ///< point; -1: none
  span<const std::int32_t> offsets;  ///< of each keyframe's keypoints, as many as keyframes; empty: nobody knows
};

/// One track with what became of it.
struct created_track {
  creation_outcome outcome;     ///< `*_query`: of a view of the query; `*_neighbour`: of another
  creation_method method;       ///< where the estimate began; stereo_query: with the depth of the query
  std::int32_t views;           ///< that are left; meaningful where accepted
  vec3<double> position;        ///< world, m; meaningful where accepted
  point_covariance covariance;  ///< of the position; meaningful where accepted
};
static_assert(sizeof(created_track) == sizeof(creation_outcome) + sizeof(creation_method) + sizeof(std::int32_t) +
                                           sizeof(vec3<double>) + sizeof(point_covariance),
              "no padding: a memory checker would find it in the copy from a device");

/// What one call made points of; all 0 where it made them of pairs.
struct creation_summary {
  std::size_t tracks = 0;          ///< that matches were joined into
  std::size_t contradictions = 0;  ///< matches that contradict a track
  std::size_t known = 0;           ///< tracks of landmarks that have a point already
  std::size_t views_left_out = 0;  ///< of accepted tracks: they did not fit
};

}  // namespace turbomap
