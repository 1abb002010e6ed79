// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a frame is to an adjustment: its state, how many unknowns it has, and how a step changes it.
///
///     struct my_frame {
///       static constexpr int dof = 15;           // unknowns of a frame: the size of its block
///       static constexpr int landmark_dof = 6;   // factors with landmarks depend on the first so many of them: 1 to dof
///       template <class S> struct state { ... }; // trivially copyable for S = double
///       template <class S> TURBOMAP_HD static state<S> retract(const state<double>& x, const S* step);
///       template <class S> TURBOMAP_HD static rigid_transform<S> pose(const state<S>& x);   // T_cw, for reprojections
///     };
///
/// S is double, or a dual number when derivatives are taken at step = 0. Where reprojection groups are used, the first six
/// unknowns are those of the pose, as in pose_frame.

#include "../config.hpp"
#include "../math/rotation.hpp"
#include "../types.hpp"

namespace turbomap {

/// A frame that is a pose `T_cw`. Its step is (omega, v), radians then metres, on the left: T_cw <- exp(omega, v) T_cw. The
/// quaternion has unit length afterwards.
struct pose_frame {
  static constexpr int dof = 6;           ///< unknowns of a step
  static constexpr int landmark_dof = 6;  ///< observations of landmarks depend on all of them
  template <class S>
  using state = rigid_transform<S>;  ///< world to the body of the rig

  /// The pose after a step.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static rigid_transform<S> retract(const rigid_transform<double>& T_cw, const S* step) {
    return left_exp(step, T_cw);
  }
  /// The pose.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static const rigid_transform<S>& pose(const rigid_transform<S>& T_cw) {
    return T_cw;
  }
};

/// A pose and a lens of its own: focal length (px) and two radial coefficients [BAL: Agarwal et al., ECCV 2010].
template <class S>
struct self_calibrated_state {
  rigid_transform<S> T_cw;  ///< world to camera
  S f = S(1);               ///< px
  S k1 = S(0);              ///< of r^2, r in normalised coordinates
  S k2 = S(0);              ///< of r^4
};

/// The nine-parameter cameras of BAL: six of the pose as in pose_frame, then f, k1, k2.
struct self_calibrated_frame {
  static constexpr int dof = 9;           ///< unknowns of a step
  static constexpr int landmark_dof = 9;  ///< observations of landmarks depend on all of them
  template <class S>
  using state = self_calibrated_state<S>;  ///< pose and lens

  /// The state after a step.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static self_calibrated_state<S> retract(const self_calibrated_state<double>& x, const S* step) {
    return {left_exp(step, x.T_cw), S(x.f) + step[6], S(x.k1) + step[7], S(x.k2) + step[8]};
  }
  /// The pose.
  template <class S, class = detail::this_target>
  TURBOMAP_HD static const rigid_transform<S>& pose(const self_calibrated_state<S>& x) {
    return x.T_cw;
  }
};

}  // namespace turbomap
