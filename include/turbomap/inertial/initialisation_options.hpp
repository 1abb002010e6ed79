// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Options and result of initialise_inertial(), as plain data.

#include <cstdint>

#include "../plain_vector.hpp"
#include "../types.hpp"
#include "imu_samples.hpp"

namespace turbomap {

/// Options of initialise_inertial(). What a default is taken from stands beside it; 'ours' are justified in docs/inertial.md.
struct initialisation_options {
  bool monocular = false;   ///< the unit of length of the poses is not known: estimate the scale
  int min_keyframes = 10;   ///< at least 5 [ORB-SLAM3: 10]
  double min_seconds = 2;   ///< from the first keyframe to the last [ORB-SLAM3: 2 monocular, 1 stereo]
  double gravity = 9.81;    ///< m/s^2
  imu_bias<double> bias{};  ///< expected beforehand, e.g. of a calibration
  /// \name How far the biases are from it, standard deviations. Ours: consumer MEMS sensors, not calibrated
  /// @{
  double gyro_bias_sigma = 0.1;          ///< rad/s
  double acceleration_bias_sigma = 0.2;  ///< m/s^2
  /// @}
  /// \name Least errors of the poses, standard deviations. The true ones are estimated from the residuals
  /// @{
  double rotation_sigma = 2e-4;  ///< rad; ours: 0.1 px at a focal length of 450 px
  double position_sigma = 0;     ///< of a camera centre, in the unit of the poses
  /// @}
  /// \name When the result is believed: largest standard deviations
  /// @{
  double max_scale_sigma = 0.01 / 3;  ///< relative; ours: three of them are 1 %
  double max_gravity_sigma = 0.01;    ///< rad; ours: half of what a bias of 0.2 m/s^2 that nobody noticed makes
  /// @}
  int max_iterations = 20;  ///< of Gauss-Newton; above 8: the weights of the edges settle in the first eight
  /// \name What inertial_initialisation takes of a map
  /// @{
  double most_seconds = 30;  ///< back in time from the keyframe. Ours: the biases are one unknown, and walk
  /// s: a motion whose duration differs by more from the time between its keyframes is refused. Ours: two periods at 200 Hz, as
  /// inertial_adjustment_options::max_time_error.
  double max_time_error = 0.01;
  /// @}
};

/// How initialise_inertial() ended. Everything but `initialised`: not initialised, use none of the values.
enum class initialisation_end : unsigned char {
  initialised,
  too_few_keyframes,
  too_short,        ///< in time
  interrupted,      ///< initialisation::edge has no duration: the IMU has a gap there
  gravity_unknown,  ///< gravity_sigma is above the limit: not enough rotation or acceleration
  scale_unknown,    ///< scale_sigma is above the limit: not enough acceleration
  not_converged
};

/// What initialise_inertial() found. The world is that of the given poses, but metric: positions are `scale` times those given.
struct initialisation {
  /// That it was initialised, or why not.
  initialisation_end end = initialisation_end::too_few_keyframes;
  int edge = -1;                        ///< where the IMU was interrupted
  double seconds = 0;                   ///< from the first keyframe to the last
  double scale = 1;                     ///< metres per unit of the poses; 1 where it was not asked for
  vec3<double> gravity{0, 0, 0};        ///< in the world of the poses, m/s^2
  imu_bias<double> bias{};              ///< of the IMU
  plain_vector<vec3<double>> velocity;  ///< of the IMU in the world of the poses, per keyframe, m/s

  /// \name Standard deviations of the result
  /// @{
  double scale_sigma = 0;    ///< relative; 0 where it was not asked for
  double gravity_sigma = 0;  ///< rad, the larger one of two directions
  double gyro_bias_sigma = 0, acceleration_bias_sigma = 0,
         velocity_sigma = 0;  ///< the largest of three; the last velocity's
  /// @}
  /// \name How well poses and IMU agree
  /// @{
  double rotation_sigma = 0, position_sigma = 0;  ///< errors of the poses as estimated: rad; the unit of the poses
  double chi2 = 0;                                ///< sum of the squared whitened residuals ...
  int degrees_of_freedom = 0;                     ///< ... which should be about this
  /// @}
  /// Of Gauss-Newton.
  int iterations = 0;
  /// The estimate of the bias is so far from that of the preintegrations that they should be integrated again at `bias`
  /// (preintegration_options), and this called again: until then the result is right to first order. Also where it was not
  /// initialised: what the first order leaves out of an interval of some seconds hides the scale, or makes it a wrong one.
  bool integrate_again = false;

  /// True when it was initialised.
  explicit operator bool() const { return end == initialisation_end::initialised; }
};

}  // namespace turbomap
