// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The options of all stages of local mapping in one place, as plain data.

#include "../appearance/appearance_view.hpp"
#include "../culling/probation.hpp"
#include "../culling/redundancy.hpp"
#include "../matching/creation_plan.hpp"
#include "../matching/search_options.hpp"
#include "fusion_options.hpp"
#include "guard_times.hpp"
#include "inertial_adjustment_options.hpp"
#include "local_adjustment_options.hpp"
#include "mapping_report.hpp"
#include "neighbour_search_options.hpp"

namespace turbomap {

/// Options of local_mapper: begin with stereo(), monocular() or one of those for an inertial unit. What they leave as it is,
/// and what a plain local_mapper_options{} is, are the values of [ORB-SLAM3] for stereo; that has no stereo_baseline, so that
/// neighbours are chosen as for one camera.
struct local_mapper_options {
  per_stage<bool> enabled{{true, true, true, true, true, true, true}};  ///< for ablation
  /// Of all points that are mirrored (working_map.hpp): how many are compared with the map on each keyframe, so that what
  /// nobody reported is found within 1 / checked_share keyframes, or as many as there are keyframes in the map. 0: none. Ours.
  double checked_share = 0.01;
  double deadline_ms = 0;  ///< per keyframe; work that is expected to overrun is cut at a safe point. 0: none
  /// Keep how well points are known in the map, where its traits can write it (map_traits): for tracking, and for
  /// fusion.covariances, which computes them itself for other maps. Noise of the pixels as in `adjustment`.
  bool covariances = false;
  /// What contradicts itself in the map, or is not finite, ends process() with inconsistent_map. Off: it is noted in
  /// mapping_report::refused, and the work is done without it.
  bool strict = false;
  /// Stages read so many points, with their observations, while they hold the map's guard once, and write as many appearances, or
  /// insert a quarter as many points, or take so many from a keyframe that is culled: so that others may enter in between. What
  /// others move meanwhile is read anew; no more points are inserted then. 0: all at once. Parts of other commits have their own
  /// options (adjustment.points_per_guard, fusion.commit.entries_per_guard). Ours: see docs/local_mapping.md for the times.
  int points_read_per_guard = default_points_read_per_guard;
  int most_views = appearance_options{}.most_views;  ///< of a point, for its descriptor and normal; 0: all [ORB-SLAM3]
  /// Fusion and adjustment of a keyframe are repeated so often at most, while fusion finds something: where few points link a
  /// keyframe to the map, the pose that it comes with hides most links, and adjustment follows the few that are left.
  /// 0: once each [ORB-SLAM3]. Ours. A round that is not expected to end before the deadline is not begun.
  int extra_rounds = 0;
  neighbour_search_options neighbours;        ///< fusion and culling choose their keyframes by its `neighbourhood` too
  search_options search;                      ///< of the correspondence search.
  creation_options creation;                  ///< of new points.
  fusion_options fusion;                      ///< of duplicates.
  local_adjustment_options adjustment;        ///< of the mapper's own solver.
  inertial_adjustment_options inertial;       ///< where the mapper is given an inertial_adjustment
  map_point_culling_options point_culling;    ///< of points on probation.
  keyframe_culling_options keyframe_culling;  ///< of redundant keyframes.

  /// The pyramid of every stage.
  void set_scales(const pyramid& scales) {
    search.scales = creation.scales = fusion.search.scales = adjustment.scales = scales;
    fusion.commit.tolerance.scale_factor = scales.scale_factor;
  }

  /// Stereo: a pair or rig of baseline (m); only points nearer than max_depth (m; usually 35 to 40 baselines) make a keyframe
  /// redundant.
  static local_mapper_options stereo(double baseline, double max_depth, const pyramid& scales = {}) {
    local_mapper_options o;
    o.neighbours.stereo_baseline = baseline;
    o.keyframe_culling.max_depth = static_cast<float>(max_depth);
    o.set_scales(scales);
    return o;
  }
  /// Defaults of a system with one camera [ORB-SLAM3].
  static local_mapper_options monocular(const pyramid& scales = {}) {
    local_mapper_options o;
    o.neighbours.neighbourhood.neighbours = 30;
    o.point_culling.fewest_measurements = 2;
    o.set_scales(scales);
    return o;
  }
  /// Stereo with an inertial unit.
  static local_mapper_options stereo_inertial(double baseline, double max_depth, const pyramid& scales = {}) {
    local_mapper_options o = stereo(baseline, max_depth, scales);
    o.set_inertial();
    o.keyframe_culling.redundant_share = 0.5F;
    return o;
  }
  /// One camera with an inertial unit.
  static local_mapper_options monocular_inertial(const pyramid& scales = {}) {
    local_mapper_options o = monocular(scales);
    o.set_inertial();
    return o;
  }
  /// Steps and end of the adjustments of [ORB-SLAM3], with and without an IMU.
  void use_published_steps() { adjustment.use_published_steps(), inertial.use_published_steps(); }
  /// These options changed for trajectories near the bound at 1.4 to 2.3 times the time:
  /// `local_mapper_options::stereo(...).balanced()`. It keeps true observations that the defaults lose: gates let 99.9 % of
  /// them pass instead of 95 %, octaves may be one off, and a keyframe is redundant when more than 8 others see its points. The
  /// map keeps covariances of its points, for tracking. For few wrong associations and pixel errors of at most 1 px at octave 0.
  /// Meant to end with adjust_globally() and rounds of fuse_around(), which find the links that drift hid. What each part gains and
  /// costs: docs/evaluation.md. Ours.
  local_mapper_options balanced() const {
    constexpr double mono_chi2 = 13.816, stereo_chi2 = 16.266;  // 99.9 %, 2 and 3 dof
    local_mapper_options o = *this;
    o.covariances = true;
    int& predecessors = o.neighbours.neighbourhood.temporal_neighbours;
    if (predecessors < 10) predecessors = 10;  // where a camera turns away from all that it knows
    o.creation.mono_chi2 = o.fusion.search.mono_chi2 = mono_chi2;
    o.creation.stereo_chi2 = o.fusion.search.stereo_chi2 = stereo_chi2;
    o.creation.known_octaves = 255;  // measured with any octave; fusion reaches farther, too
    // At the point's own octave and finer ones the window holds the monocular gate, sqrt(13.816) = 3.72. It cuts what lies between
    // 4 and the gate of one octave coarser, 4.46 (scale factor 1.2), or the stereo gate, 4.03.
    o.fusion.search.radius = 4;
    o.fusion.search.finer_octaves = 2;  // a point's own octave and a keypoint's may each be one off
    o.fusion.search.coarser_octaves = 1;
    o.adjustment.outlier_factor = mono_chi2 / o.adjustment.mono_chi2;  // of stereo, too: 18.02, which is 99.96 %
    o.keyframe_culling.observers = 8;
    return o;
  }
  /// The same for trajectories as exact as the observations allow. Beside what balanced() changes, fusion and adjustment are
  /// repeated since a wrong pose hides links, and no keyframe is culled, so that time and memory grow with the map. Meant to
  /// end with adjust_globally() and rounds of fuse_around(). Ours.
  local_mapper_options accurate() const {
    local_mapper_options o = balanced();
    o.fusion.covariances = true;
    // A scale that hangs on few points is a direction of little curvature: few steps do not bring it back.
    o.adjustment.solve.max_iterations = 20;
    o.adjustment.solve.min_relative_decrease = 1e-5, o.adjustment.solve.slow_iterations = 3;
    o.extra_rounds = 2;
    o.keyframe_culling = keyframe_culling;
    o.enabled[mapping_stage::keyframe_culling] = false;
    return o;
  }

 private:
  void set_inertial() {
    creation.max_parallax_cosine = 0.9996;
    neighbours.neighbourhood.temporal_neighbours = 11;
    neighbours.neighbourhood.temporal_targets = 20;
    keyframe_culling.temporal_guards = true;
  }
};

}  // namespace turbomap
