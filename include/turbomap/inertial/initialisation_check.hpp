// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which options and motions initialise_inertial() refuses.

#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "imu_check.hpp"
#include "initialisation_options.hpp"
#include "preintegration.hpp"

TURBOMAP_BEGIN_NAMESPACE
namespace detail {

constexpr int weighing_rounds = 8;  ///< steps of initialise_inertial() in which the weights of its edges settle

inline void check_initialisation_options(const initialisation_options& o) {
  require(o.min_keyframes >= 5, "options.min_keyframes", o.min_keyframes, "must be 5 at least");
  check_not_negative("options.min_seconds", o.min_seconds);
  require(o.max_iterations > weighing_rounds, "options.max_iterations", o.max_iterations,
          "must be above 8, the steps in which the weights settle: it cannot converge before");
  check_positive("options.gravity", o.gravity);
  check_positive("options.gyro_bias_sigma", o.gyro_bias_sigma);
  check_positive("options.acceleration_bias_sigma", o.acceleration_bias_sigma);
  check_not_negative("options.rotation_sigma", o.rotation_sigma);
  check_not_negative("options.position_sigma", o.position_sigma);
  check_not_negative("options.max_scale_sigma", o.max_scale_sigma);
  check_not_negative("options.max_gravity_sigma", o.max_gravity_sigma);
  check_bias("options.bias", o.bias);
}

inline void check_motion(std::size_t i, const preintegration<double>& p) {
  const argument_name motion("motion", i);
  if (!(p.dt >= 0 && is_finite(p.dt))) reject(motion + ".dt", p.dt, "must be finite and not negative");
  check_bias(motion, p.bias, ".bias");
  const double sum = sum_of_elements(p);
  if (!is_finite(sum)) reject(motion.text(), sum, "must hold finite numbers");
}

}  // namespace detail
TURBOMAP_END_NAMESPACE
