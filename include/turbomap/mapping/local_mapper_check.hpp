// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which options a local_mapper refuses when it is made, and before a keyframe is processed: its own, and those of the stages
/// that are on. A stage checks its options too, but the stages before it have changed the map by then.

#include <cstring>
#include <stdexcept>
#include <string>

#include "../adjustment/options_check.hpp"
#include "../config.hpp"
#include "../error.hpp"
#include "../fusion/projection_check.hpp"
#include "../map/neighbourhood.hpp"
#include "../matching/creation_check.hpp"
#include "../matching/search_check.hpp"
#include "fusion_commit.hpp"
#include "local_adjustment_check.hpp"
#include "local_mapper_options.hpp"
#include "mapper_adjustment.hpp"
#include "redundant_keyframes.hpp"

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
  check_same_pyramid("options.creation.scales", options.creation.scales, options.search.scales);
  check_same_pyramid("options.fusion.search.scales", options.fusion.search.scales, options.search.scales);
  check_same_pyramid("options.adjustment.scales", options.adjustment.scales, options.search.scales);
}

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// check(), which names the options of a stage; here they are a member of the mapper's.
template <class Check>
void check_member(const char* member, const Check& check) {
  try {
    check();
  } catch (const std::invalid_argument& error) {
    constexpr const char* of_stage = "turbomap: options.";
    const std::string text = error.what();
    if (text.rfind(of_stage, 0) != 0) throw;
    throw std::invalid_argument(std::string(of_stage).append(member).append(".").append(text, std::strlen(of_stage)));
  }
}

/// Throws std::invalid_argument naming an option of a stage that is on and would refuse it; adjustment is left out.
template <class Map>
void check_stages(const local_mapper_options& o) {
  using descriptor = typename map_traits<Map>::descriptor;
  const auto& on = o.enabled;
  if (on[mapping_stage::point_culling]) check_member("point_culling", [&] { check(o.point_culling); });
  if (on[mapping_stage::search] || on[mapping_stage::fusion] || on[mapping_stage::keyframe_culling])
    check_member("neighbours.neighbourhood", [&] { check(o.neighbours.neighbourhood); });
  if (on[mapping_stage::search]) check_member("search", [&] { check_search_options<descriptor>(o.search); });
  if (on[mapping_stage::creation])
    check_member("creation", [&] { check_creation_options(o.creation, o.search.scales.scale_factor); });
  if (on[mapping_stage::fusion]) {
    check_member("fusion.search", [&] { check_projection_options<descriptor>(o.fusion.search); });
    check_member("fusion.commit", [&] { check_fusion_commit(o.fusion.commit); });
  }
  if (on[mapping_stage::keyframe_culling])
    check_member("keyframe_culling", [&] { check_culling<Map>(o.keyframe_culling); });
}

/// The same of the adjustment that the mapper runs on the map of its stages.
template <class Adjustment, class Map>
void check_adjustment(const local_mapper_options& o) {
  using methods = typename adjustment_on<Adjustment, Map>::methods;
  check_member("adjustment", [&] { check(o.adjustment); });
  check_member("adjustment.solve", [&] { require_options<methods>(o.adjustment.solve); });
  if constexpr (is_inertial<Adjustment>::value) {  // whoever names that adjustment includes its check
    const auto found_later = [](const auto& of_imu) { check(of_imu); };
    check_member("inertial", [&] { found_later(o.inertial); });
  }
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
