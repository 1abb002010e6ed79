// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What point creation demands of its options, on the host before anything is changed.

#include <string>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../store/argument_checks.hpp"
#include "creation_plan.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that cannot be.
/// \param searched  scale factor of the search whose matches are used
inline void check_creation_options(const creation_options& options, float searched) {
  check_positive("options.mono_chi2", options.mono_chi2);
  check_positive("options.stereo_chi2", options.stereo_chi2);
  check_scales(options.scales);
  check_factor("options.scale_tolerance", options.scale_tolerance);
  require(options.max_parallax_cosine <= 1, "options.max_parallax_cosine", options.max_parallax_cosine,
          "must be a cosine");
  check_not_negative("options.max_distance", options.max_distance);
  if (options.scales.scale_factor != searched) {  // octaves would be compared by two rules
    const std::string rule = std::string("must be that of the search, ").append(printed(searched));
    reject("options.scales.scale_factor", options.scales.scale_factor, rule.c_str());
  }
  require(options.refinement_steps >= 0, "options.refinement_steps", options.refinement_steps, "must not be negative");
  check_not_negative("options.refinement_tolerance", options.refinement_tolerance);
  require(options.known_views >= 0, "options.known_views", options.known_views, "must not be negative");
  check_not_negative("options.known_chi2", options.known_chi2);
  require(options.known_octaves >= 0, "options.known_octaves", options.known_octaves, "must not be negative");
  require(options.fewest_keyframes >= 1, "options.fewest_keyframes", options.fewest_keyframes, "must be at least 1");
  require(options.lookalike_ratio >= 0 && options.lookalike_ratio <= 1, "options.lookalike_ratio",
          options.lookalike_ratio, "must be in [0, 1]");
  check_correlation("options.stereo_correlation", options.stereo_correlation);
}

TURBOMAP_END_NAMESPACE
