// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the options of a local_mapper mean for each stage, where one option is for several stages.

#include "../appearance/appearance_view.hpp"
#include "../config.hpp"
#include "../map/map_traits.hpp"
#include "local_mapper_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Tracks may have views by several cameras of a rig.
inline search_options search_of(const local_mapper_options& of) {
  search_options options = of.search;
  if (of.creation.rule == creation_rule::tracks) options.across_rig = options.across_rig || of.neighbours.across_rig;
  return options;
}

/// Errors of stereo keypoints are as in adjustments.
inline fusion_options fusion_of(const local_mapper_options& of) {
  fusion_options options = of.fusion;
  options.stereo_correlation = of.adjustment.stereo_correlation;
  return options;
}

/// \param left_ms  until the keyframe is due: adjustment ends by then, where there is a deadline
inline local_adjustment_options adjustment_of(const local_mapper_options& of, double left_ms) {
  local_adjustment_options options = of.adjustment;
  const double limit = options.solve.time_budget_ms;
  if (of.deadline_ms > 0 && !(limit > 0 && limit < left_ms)) options.solve.time_budget_ms = left_ms;
  return options;
}

/// Covariances are computed where the map can keep them.
template <class Map>
appearance_options appearance_of(const local_mapper_options& of) {
  appearance_options options;
  options.scales = of.fusion.search.scales;
  options.most_views = of.most_views;
  if constexpr (map_has_v<Map, map_covariance_member>) {
    options.covariance = of.covariances;
    options.stereo_correlation = of.adjustment.stereo_correlation;
  }
  return options;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
