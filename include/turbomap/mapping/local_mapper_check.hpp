// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which options a local_mapper refuses when it is made. Its own are here, and of the stages' the baseline of
/// stereo neighbours and the culling of keyframes; all others are checked by their stage when it is called.

#include "../error.hpp"
#include "local_mapper_options.hpp"

namespace turbomap {

/// Throws std::invalid_argument where what has the name has another pyramid than the searches of the mapper.
inline void check_same_pyramid(const char* name, const pyramid& scales, const pyramid& of_search) {
  require(scales.levels == of_search.levels, name, scales.levels,
          "levels: must be those of options.search.scales (set_scales)");
  require(scales.scale_factor == of_search.scale_factor, name, scales.scale_factor,
          "as scale factor: must be that of options.search.scales (set_scales)");
}

/// Throws std::invalid_argument naming an option that makes no sense.
inline void check(const local_mapper_options& options) {
  const auto not_negative = [](const char* name, auto value) {
    require(value >= 0, name, value, "must not be negative");
  };
  not_negative("options.deadline_ms", options.deadline_ms);
  not_negative("options.checked_share", options.checked_share);
  not_negative("options.points_read_per_guard", options.points_read_per_guard);
  not_negative("options.extra_rounds", options.extra_rounds);
  not_negative("options.most_views", options.most_views);
  not_negative("options.neighbours.stereo_baseline", options.neighbours.stereo_baseline);
  check(options.keyframe_culling);
  check_same_pyramid("options.creation.scales", options.creation.scales, options.search.scales);
  check_same_pyramid("options.fusion.search.scales", options.fusion.search.scales, options.search.scales);
  check_same_pyramid("options.adjustment.scales", options.adjustment.scales, options.search.scales);
}

}  // namespace turbomap
