// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options of the stage that adjusts a map with its IMU, as plain data.

#include "../inertial/inertial_window_options.hpp"

namespace turbomap {

/// Options of inertial_adjustment. Defaults are those of [ORB-SLAM3] unless a comment says otherwise. What they have in common
/// with visual adjustments is in local_adjustment_options: scales, gates, correlation, precision, the end, stop, deadline.
struct inertial_adjustment_options {
  inertial_window_options window;                           ///< where tracking is not strong
  inertial_window_options large = large_inertial_window();  ///< where tracking is strong
  /// Tracking is strong where the current keyframe sees so many points. Ours. 0: always; negative: never.
  int strong_points = 100;
  /// Keyframes outside of the window hold its points in place: of each point the first one that is not there yet, in the order
  /// of its observations, until there are so many.
  int most_observers = 200;
  /// Where the window begins with the map, fewer edges than this do not tell biases and gravity well: those of the first keyframe,
  /// and its orientation, stay. Ours: one more than the ten keyframes have that initialisation asks for; with nine edges, and few
  /// points, velocities become worse, not better (test_inertial_window_adjustment.cpp).
  int fewest_edges = 10;
  /// What a keyframe that leaves the window knew of the next one becomes a prior of that one (border_prior.hpp): the
  /// keyframe before the window moves then, too, and its edge counts in full. Off: it is fixed, and its edge counts as
  /// window.oldest_edge_weight says.
  bool marginal_prior = false;
  double near_depth = 10;  ///< m: local_adjustment_options::near_depth
  /// s: a motion whose duration differs by more from the time between its keyframes is refused: it belongs to other ones. Ours:
  /// two periods at 200 Hz.
  double max_time_error = 0.01;
  /// m/s^2: a motion whose velocity or position asks for a larger mean force per mass is refused: no sensor felt it, and
  /// one such edge would drag the window along. When a keyframe is culled, it is not merged into the next one's.
  double max_force = default_max_force;

  /// The damping of [ORB-SLAM3]. Its end is that of local_adjustment_options::use_published_steps();
  /// local_mapper_options::use_published_steps() does both.
  void use_published_steps() {
    window.damping = large.damping = damping_rule::identity;
    window.initial_lambda = 1, large.initial_lambda = 1e-2;
  }
};

}  // namespace turbomap
