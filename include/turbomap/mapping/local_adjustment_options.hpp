// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options of the stage that adjusts poses and points around a keyframe, and what it tells, as plain data.

#include <cstddef>

#include "../adjustment/options.hpp"
#include "../types.hpp"

namespace turbomap {

/// Options of local_adjustment. Defaults are those of [ORB-SLAM3], but for its steps and its end: see the constructor.
struct local_adjustment_options {
  adjustment_options solve;    ///< of the solver; changed by the constructor
  pyramid scales;              ///< information of a keypoint: scale_factor^(-2 octave) px^-2
  int min_shared_points = 15;  ///< keyframes that share so many with the current one move with it
  /// Keyframes that share so many with one of those move too: where a place is seen again, the error of the way there is
  /// spread over more keyframes. 0: none [ORB-SLAM3].
  int second_min_shared_points = 0;
  /// No more keyframes than this move: the current one and those that share most points with it, equal ones in order of insertion; then
  /// the second order. The others that see their points are fixed. It bounds the keyframe after a long gap, when nothing was fused or
  /// culled for long. Chosen above what any recording has (about 80), so that they are adjusted as by [ORB-SLAM3]; 0: no bound.
  int most_keyframes = 128;
  double mono_chi2 = 5.991;    ///< Huber's delta^2: 95 %, 2 dof
  double stereo_chi2 = 7.815;  ///< 95 %, 3 dof
  /// Outliers, which leave the map, are beyond so many times these. 1 [ORB-SLAM3]: one in twenty true observations is, and
  /// estimates without them are 12 % less exact (docs/evaluation.md). 2.31: 99.9 %.
  double outlier_factor = 1;
  /// Observations without u_right of points nearer than this (m) are outliers beyond near_mono_factor times that only. 0:
  /// none [ORB-SLAM3; inertial: 10 m]
  double near_depth = 0;
  double near_mono_factor = 1.5;  ///< [ORB-SLAM3, inertial]
  double stereo_correlation = 0;  ///< of the errors of u and u_right: see reprojections; 0 [ORB-SLAM3]
  int fewest_measurements = 2;    ///< a point dies when outliers leave it so many measurements or fewer
  /// A result of more points than this, an outlier counting as four, is written in parts of this size, so that others may enter
  /// in between: the poses first. Before that, observations beyond their gate are looked at, a quarter as many in a part. Chosen for
  /// less than 1 ms on one core of 2025; 0: always all while the guard is held once.
  int points_per_guard = 1024;

  /// The defaults. A window is nearly linear, so damped by its own diagonal the cost falls to its least in a few iterations, and the
  /// first one that gains less than 3e-4 ends it. Ours. use_published_steps() takes twice as many and ends no nearer (docs/adjustment.md).
  local_adjustment_options() { solve.min_relative_decrease = 3e-4, solve.slow_iterations = 1; }
  /// Steps and end of [ORB-SLAM3]: damping by the identity, which holds weak directions for long, so that an iteration that gains
  /// little is not the end yet: the third one below 1e-3 in a row is.
  void use_published_steps() {
    solve.damping = damping_rule::identity;
    solve.min_relative_decrease = 1e-3, solve.slow_iterations = 3;
  }
};

/// What one local adjustment did.
struct local_adjustment_summary {
  adjustment_summary solve;         ///< of the solver
  bool inertial = false;            ///< the IMU took part: by inertial_adjustment, once it is initialised
  std::size_t inertial_edges = 0;   ///< between keyframes that follow each other in time
  std::size_t free_keyframes = 0;   ///< that could move
  std::size_t fixed_keyframes = 0;  ///< that see the same points
  std::size_t points = 0;           ///< that could move
  std::size_t observations = 0;     ///< of those points by those keyframes
  std::size_t outliers = 0;         ///< observations taken out of the map
  std::size_t points_erased = 0;    ///< that outliers left with too few
  bool stale = false;               ///< a free keyframe was moved or erased meanwhile: nothing was written from then on
};

}  // namespace turbomap
