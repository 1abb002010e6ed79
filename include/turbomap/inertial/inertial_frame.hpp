// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A frame of 15 unknowns for bundle_problem: pose, velocity, and the biases of the IMU. Observations of landmarks depend on
/// its pose alone; the factors of inertial_factors.hpp join it with the frame that follows in time.

#include <cstdint>
#include <type_traits>

#include "../config.hpp"
#include "inertial_residual.hpp"
#include "preintegration.hpp"

namespace turbomap {

/// Unknowns as in inertial_state: 6 of the pose (those of pose_frame), velocity (m/s), bias of the gyroscope (rad/s) and of
/// the accelerometer (m/s^2).
struct inertial_frame {
  static constexpr int dof = 15;          ///< unknowns of a step
  static constexpr int landmark_dof = 6;  ///< of which observations of landmarks depend on the first so many: the pose
  /// State of a frame.
  template <class S>
  using state = inertial_state<S>;

  /// \name Bits of frame_input::held
  /// @{
  static constexpr std::uint32_t hold_pose = 0x3F, hold_velocity = 7U << 6, hold_biases = 63U << 9;
  static constexpr std::uint32_t hold_centre = 7U << 3;  ///< a step of the rotation alone leaves the camera's centre
  static constexpr std::uint32_t visual_only = hold_velocity | hold_biases;  ///< of a frame that nothing inertial joins
  /// @}

  /// A pose whose step is 0 stays to the last bit.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static inertial_state<S> retract(const inertial_state<double>& x, const S* step) {
    inertial_state<S> moved = move_state(step, x);
    if constexpr (std::is_same_v<S, double>) {
      bool still = true;
      for (int i = 0; i < 6; ++i) still = still && step[i] == 0;
      if (still) moved.T_cw = x.T_cw;
    }
    return moved;
  }
  /// World to the frame of the visual residuals.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static const rigid_transform<S>& pose(const inertial_state<S>& x) {
    return x.T_cw;
  }
};

}  // namespace turbomap
