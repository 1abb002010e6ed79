// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The sizes and weights of a window of keyframes that is adjusted with its IMU, as plain data.

#include "../adjustment/damping_rule.hpp"

namespace turbomap {

/// m/s^2: no body that carries a camera feels a larger mean force per mass, so no motion asks for one. Ours: 100 times
/// gravity.
inline constexpr double default_max_force = 1000;

/// Defaults are those of [ORB-SLAM3]'s local inertial adjustment, but for the damping. The first four are for the caller, who
/// chooses the window and the adjustment_options; inertial_edges reads the others.
struct inertial_window_options {
  int keyframes = 10;   ///< the last ones in time, that move
  int iterations = 10;  ///< of their adjustment
  /// Of it. Radians, metres, metres per second and biases meet in one system: a multiple of the identity is large for some
  /// and nothing to others. [ORB-SLAM3: identity]
  damping_rule damping = damping_rule::diagonal;
  /// Of it. So small that it holds nothing: scale and biases are weak directions, which 1e-4 would hold for longer than a window
  /// lasts. Above the rounding of float32, in which mixed precision forms the equations. 0: the solver's own, those 1e-4.
  /// [ORB-SLAM3: 1; 1e-2 in the large window]
  double initial_lambda = 1e-6;
  /// Of the information of the oldest edge: it leans on a keyframe that does not move any more.
  double oldest_edge_weight = 1e-2;
  double robust_chi2 = 16.92;  ///< Huber's delta^2 of robust edges: 95 % of chi-square, nine degrees of freedom
  bool all_robust = false;     ///< every edge, not the oldest alone: soon after the IMU was initialised
};

/// The large window: where tracking is strong, so that fewer iterations do.
inline inertial_window_options large_inertial_window() {
  inertial_window_options o;
  o.keyframes = 25, o.iterations = 4;
  return o;
}

}  // namespace turbomap
