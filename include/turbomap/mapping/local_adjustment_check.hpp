// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which options of an adjustment of the map make no sense.

#include "../config.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../store/argument_checks.hpp"
#include "local_adjustment_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that is out of range.
inline void check(const local_adjustment_options& o) {
  check_scales(o.scales);
  check_positive("options.mono_chi2", o.mono_chi2);
  check_positive("options.stereo_chi2", o.stereo_chi2);
  check_positive("options.outlier_factor", o.outlier_factor);
  check_correlation("options.stereo_correlation", o.stereo_correlation);
  require(o.min_shared_points >= 0, "options.min_shared_points", o.min_shared_points, "must not be negative");
  require(o.second_min_shared_points >= 0, "options.second_min_shared_points", o.second_min_shared_points,
          "must not be negative");
  require(o.most_keyframes >= 0, "options.most_keyframes", o.most_keyframes, "must not be negative");
  require(o.fewest_measurements >= 0, "options.fewest_measurements", o.fewest_measurements, "must not be negative");
  require(o.points_per_guard >= 0, "options.points_per_guard", o.points_per_guard, "must not be negative");
  require(o.near_depth >= 0, "options.near_depth", o.near_depth, "must not be negative");
  check_positive("options.near_mono_factor", o.near_mono_factor);
}

TURBOMAP_END_NAMESPACE
