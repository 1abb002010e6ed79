// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The factor groups that a problem is made of, as the caller gives them: plain views of host arrays, read by
/// bundle_problem::assign() and not kept. A group is many residual blocks of one kind, SoA.
///
/// The user's own factor is a trivially copyable struct. `row` is what differs between its blocks (trivially copyable too).
/// Its residual is whitened, that is, divided by its standard deviation:
///
///     struct my_factor {
///       static constexpr int size = 2;          // residuals of a block
///       struct row { ... };
///       // with a landmark:   false: not defined there
///       template <class Frame, class S>
///       TURBOMAP_HD bool residual(const Frame& frame, const vec3<S>& landmark, const row& r, S* e) const;
///       // of one frame:      bool residual(const Frame& frame, const row& r, S* e) const;
///       // between two:       bool residual(const Frame& first, const Frame& second, const row& r, S* e) const;
///       // optional, instead of dual numbers; row-major derivatives by the frame's step and by the landmark:
///       TURBOMAP_HD bool linearise(const state<double>& frame, const vec3<double>& landmark, const row& r, double* e,
///                                  double* d_frame /*size x landmark_dof*/, double* d_landmark /*size x 3*/) const;
///       // (of one frame: d_frame is size x dof; between two: d_first, d_second, each size x dof)
///     };
///
/// `Frame` is Frame::state<S>.

#include <cstdint>

#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "robust.hpp"

namespace turbomap {

/// Reprojections: pixels of landmarks in the cameras of a rig. A row is mono (two residuals: u, v) or, with a u_right that is
/// neither negative nor NaN, stereo (three: u, v, u_right = u - bf / depth).
/// \tparam Camera  any camera model; its own jacobian() is used where it has one, else dual numbers
template <class Camera, class Kernel = huber>
struct reprojections {
  rig_view<Camera> rig;                  ///< run-time cameras with T_camera_body and bf; copied
  span<const std::int32_t> frame;        ///< one per row: which frame sees
  span<const std::int32_t> landmark;     ///< which landmark
  span<const vec3<double>> pixel;        ///< u, v, u_right in px; negative or NaN u_right: none
  span<const double> information;        ///< 1 / sigma^2, px^-2; 0 switches a row off. Its pixel is finite all the same
  span<const std::uint8_t> camera = {};  ///< which camera of the rig; empty: the first
  span<const std::uint8_t> stereo = {};  ///< not 0: three residuals, whatever u_right is; empty: where u_right >= 0
  Kernel mono_kernel = {};               ///< kernel of rows with two residuals
  Kernel stereo_kernel = {};             ///< kernel of rows with three
  /// Of the errors of u and u_right, from 0 (independent [ORB-SLAM3]) to below 1. A u_right that was found by matching the
  /// patch of the left image moves with it: the sigma of the disparity is sqrt(2 (1 - correlation)) that of u. Too much does
  /// harm: depths are believed that are not known.
  double stereo_correlation = 0;
  /// chi2 of a row whose camera cannot project its landmark (it has no derivative then): as if it were off by 1000 px at
  /// sigma 1, so that a step does not gain by making rows undefined. Pinholes are undefined in their focal plane only: rows
  /// behind them keep the error of the formula, as in g2o and Ceres.
  double undefined_chi2 = 1e6;
  /// A row nearer to its camera (a pinhole: to its focal plane) than this part of the median distance of rows is undefined:
  /// its derivatives, f / distance, would drown those of all others. Ours: 5 mm in a scene of 5 m.
  double nearest = 1e-3;
  /// @{
  /// pixel and information once more, where a device policy computes, if they are there already: both or none. They are not
  /// sent then, and must stay until assign() returns. Host policies do not look at them.
  const vec3<double>* resident_pixel = nullptr;
  const double* resident_information = nullptr;
  /// @}
};

/// [ORB-SLAM3]'s kernels on reprojections: Huber, 95 % of chi-square with two and three degrees of freedom.
template <class Camera>
reprojections<Camera, huber> huber_reprojections(rig_view<Camera> rig) {
  reprojections<Camera, huber> group;
  group.rig = rig;
  group.mono_kernel.delta2 = 5.991, group.stereo_kernel.delta2 = 7.815;
  return group;
}

/// The user's own factors between a frame and a landmark.
template <class Factor, class Kernel = no_kernel>
struct landmark_factors {
  Factor factor;                          ///< the residual
  span<const std::int32_t> frame;         ///< [row] which frame
  span<const std::int32_t> landmark;      ///< [row] which landmark
  span<const typename Factor::row> rows;  ///< what differs between rows
  Kernel kernel = {};                     ///< of its chi2
  double undefined_chi2 = 1e6;            ///< see reprojections
};

/// Factors of one frame, e.g. a prior.
template <class Factor, class Kernel = no_kernel>
struct frame_factors {
  Factor factor;                          ///< the residual
  span<const std::int32_t> frame;         ///< [row] which frame
  span<const typename Factor::row> rows;  ///< what differs between rows
  Kernel kernel = {};                     ///< of its chi2
  double undefined_chi2 = 1e6;            ///< see reprojections
};

/// Factors between two different frames, e.g. odometry.
template <class Factor, class Kernel = no_kernel>
struct frame_pair_factors {
  Factor factor;                          ///< the residual
  span<const std::int32_t> first;         ///< [row] the first frame
  span<const std::int32_t> second;        ///< [row] the second frame, another one
  span<const typename Factor::row> rows;  ///< what differs between rows
  Kernel kernel = {};                     ///< of its chi2
  double undefined_chi2 = 1e6;            ///< see reprojections
};

/// The unknowns of the frames as the caller holds them.
template <class Frame>
struct frame_input {
  span<const typename Frame::template state<double>> states;  ///< where they begin
  span<const std::uint8_t> fixed = {};                        ///< not 0: the frame does not move; empty: all move
  /// One mask per frame: bit i holds unknown i of one that moves otherwise, e.g. the velocity where no IMU tells it. Empty:
  /// none is held. Frames of up to 32 unknowns.
  span<const std::uint32_t> held = {};
};

/// The landmarks as the caller holds them: world, m.
struct landmark_input {
  span<const vec3<double>> positions;   ///< where they begin
  span<const std::uint8_t> fixed = {};  ///< not 0: the landmark does not move; empty: all move
};

}  // namespace turbomap
