// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What motion_only takes and gives, as plain data.

#include <cstdint>

#include "../config.hpp"
#include "../types.hpp"

namespace turbomap {

/// Options of motion_only. Defaults are those of [ORB-SLAM3]'s tracking.
struct motion_only_options {
  int rounds = 4;                         ///< after each, outliers are told anew from all observations
  int iterations = 10;                    ///< Levenberg-Marquardt steps tried in a round
  int robust_rounds = 3;                  ///< rounds with Huber's kernel; the last ones are plain least squares
  double mono_chi2 = 5.991;               ///< outlier beyond it, and Huber's delta^2: 95 %, 2 dof
  double stereo_chi2 = 7.815;             ///< 95 %, 3 dof
  double stereo_correlation = 0;          ///< of the errors of u and u_right: see reprojections
  int min_observations = 3;               ///< fewer (or fewer inliers after a round): the pose stays as it was
  double initial_lambda_scale = 1e-5;     ///< of the largest diagonal element
  double min_predicted_decrease = 1e-14;  ///< of the cost: a round ends where a step promises less. At most 1e-6
  /// Takes that last step as it is. What it gains is lost in the rounding of the cost, so that one machine would take it and
  /// another not: with 1e-12 above, poses of host and device are then within 1e-14 m of each other, else within some 1e-8 m
  /// where observations are few.
  bool take_last_step = false;
  /// How often a point that is not exact is moved, at each pose. Ours: where depths are known to a third, the mean step of a
  /// camera is 0.98 of the true one after 1 as after 3, and 0.5 where points stay (0).
  int point_steps = 1;
  double point_sigmas = 3;  ///< and how far at most, in standard deviations: what needs more is an outlier. Ours
};

/// What became of one frame.
struct posed_frame {
  rigid_transform<double> T_cw;  ///< world to body
  std::int32_t inliers;          ///< of the last round
  std::int32_t adjusted;         ///< 0: the pose is to the bit what was given (few observations, not finite, no pose)
  double cost;  ///< sum of rho(chi2) of the inliers of the last round, before a last step that was taken as it is
};

}  // namespace turbomap
