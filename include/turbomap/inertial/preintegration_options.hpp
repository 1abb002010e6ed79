// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How good an IMU is, and which of its data are refused.

namespace turbomap {

/// Noise of an IMU: the densities of its data sheet, or of a calibration. Defaults are those of EuRoC's ADIS16448
/// [EuRoC, sensor.yaml: Burri et al., IJRR 2016].
struct imu_noise {
  double gyro = 1.6968e-4;          ///< white noise of the angular velocity, rad/s/sqrt(Hz)
  double acceleration = 2.0e-3;     ///< white noise of the specific force, m/s^2/sqrt(Hz)
  double gyro_walk = 1.9393e-5;     ///< random walk of the gyroscope's bias, rad/s^2/sqrt(Hz)
  double acceleration_walk = 3e-3;  ///< random walk of the accelerometer's bias, m/s^3/sqrt(Hz)
  /// 0: noise as physics has it; over a step of t seconds the variance is density^2 / t, and walks grow by density^2 t.
  /// Positive: each step, however short, has the variance density^2 * rate, and walks grow by density^2 / rate, as if
  /// all steps took 1 / rate seconds [ORB-SLAM3]: for comparison.
  double rate = 0;  ///< Hz
};

/// Which orientation turns the specific force of a step between two samples into the frame of the start.
enum class integration_rule : unsigned char {
  /// That of the middle of the step: the error of the motion falls with the square of the step.
  midpoint,
  /// That of its beginning, as published [Forster et al. 2017]; the force is half a step late. For comparison.
  first_order
};

/// Options of preintegrate() and imu_integrator.
struct preintegration_options {
  imu_noise noise;                                     ///< of the IMU
  integration_rule rule = integration_rule::midpoint;  ///< which orientation a step has
  /// Longest time between two samples, s. Ours: ten periods at 200 Hz. In between the measurements are taken from a
  /// line.
  double max_gap = 0.05;
  /// How far from an end of the interval the samples may begin or stop, s. Two periods at 200 Hz: a frame often
  /// comes before the first sample after it.
  double max_extrapolation = 0.01;
  double gyro_range = 0;          ///< full scale of the gyroscope, rad/s; values there are saturated. 0: not known
  double acceleration_range = 0;  ///< full scale of the accelerometer, m/s^2. 0: not known
  /// Change of bias beyond which an interval is integrated again instead of corrected to first order. What the first
  /// order leaves out is |change|^2 dt^2 / 2 in the rotation: 5e-5 rad after 1 s at the default, below the noise of one
  /// second (1.7e-4 rad). Of an interval of more than a second, change times duration counts, which keeps it at that.
  double max_gyro_bias_change = 0.01;  ///< rad/s
  /// The same for the accelerometer. Velocity and position are linear in it; only its product with the gyroscope's
  /// change is left out.
  double max_acceleration_bias_change = 0.1;  ///< m/s^2
};

}  // namespace turbomap
