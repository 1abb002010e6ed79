// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What local mapping can be told: the options of all stages in one place, and the hooks of the rest of the system.

#include <cstdint>
#include <functional>

#include "../map/neighbourhood.hpp"
#include "../matching/creation_plan.hpp"
#include "../matching/neighbour_rules.hpp"
#include "../matching/search_options.hpp"
#include "duplicate_fusion.hpp"
#include "keyframe_culling.hpp"
#include "map_point_culling.hpp"
#include "mapping_report.hpp"

namespace turbomap {

/// Options of local_mapper. As they come: stereo without an inertial unit, [ORB-SLAM3]'s values.
struct local_mapper_options {
  per_stage<bool> enabled{{true, true, true, true, true, true, true}};  ///< for ablation
  double stereo_baseline =
      0;                   ///< m: neighbours nearer than this are not searched; 0: monocular, the median depth decides
  double deadline_ms = 0;  ///< per keyframe; work that is expected to overrun is cut at a safe point. 0: none
  neighbourhood_options neighbourhood;
  neighbour_options baseline_rule;
  search_options search;
  creation_options creation;
  fusion_options fusion;
  map_point_culling_options point_culling;
  keyframe_culling_options keyframe_culling;

  /// The pyramid of every stage.
  void set_scales(const pyramid& scales) { search.scales = creation.scales = fusion.search.scales = scales; }

  /// Stereo: a pair or rig of baseline (m); only points nearer than max_depth (m; usually 35 to 40 baselines) make a keyframe
  /// redundant.
  static local_mapper_options stereo(double baseline, double max_depth, const pyramid& scales = {}) {
    local_mapper_options o;
    o.stereo_baseline = baseline;
    o.keyframe_culling.max_depth = static_cast<float>(max_depth);
    o.set_scales(scales);
    return o;
  }
  static local_mapper_options monocular(const pyramid& scales = {}) {
    local_mapper_options o;
    o.neighbourhood.neighbours = 30;
    o.point_culling.fewest_measurements = 2;
    o.set_scales(scales);
    return o;
  }
  /// Stereo with an inertial unit.
  static local_mapper_options stereo_inertial(double baseline, double max_depth, const pyramid& scales = {}) {
    local_mapper_options o = stereo(baseline, max_depth, scales);
    o.creation.max_parallax_cosine = 0.9996;
    o.neighbourhood.temporal_neighbours = 11;
    o.neighbourhood.temporal_targets = 20;
    o.keyframe_culling.redundant_share = 0.5F;
    o.keyframe_culling.temporal_guards = true;
    return o;
  }
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

/// What local mapping asks and tells the rest of the system. All optional; called on the mapper's thread, without the map's
/// guard where nothing else is said.
template <class Map>
struct local_mapper_hooks {
  using keyframe = typename map_traits<Map>::keyframe;

  /// More keyframes wait: fusion, adjustment and keyframe culling are skipped for this one. Asked before each of them.
  std::function<bool()> keyframes_wait;
  /// Somebody (loop closing) wants the map for himself: asked before each stage; what is left of the iteration is skipped.
  std::function<bool()> stop;
  /// Local adjustment of poses and points around the keyframe, with write-back. \param time_left_ms  infinite: no deadline
  std::function<void(Map&, keyframe, double time_left_ms)> adjust;
  /// A keyframe is about to be erased as redundant, the map's guard is held: e.g. to keep its pose relative to a parent.
  std::function<void(keyframe)> erasing;
  /// A stage came to its end.
  std::function<void(mapping_stage, const mapping_report&)> stage_done;
};

TURBOMAP_END_NAMESPACE
