// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a search by projection demands of its arguments.

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/number_checks.hpp"
#include "../store/argument_checks.hpp"
#include "projection_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that cannot be.
template <class Descriptor>
void check_projection_options(const projection_options& o) {
  check_scales(o.scales);
  check_positive("options.radius", o.radius);
  require(o.oblique_cosine >= -1 && o.oblique_cosine <= 1, "options.oblique_cosine", o.oblique_cosine,
          "must be a cosine");
  check_positive("options.oblique_factor", o.oblique_factor);
  require(o.min_view_cosine >= -1 && o.min_view_cosine <= 1, "options.min_view_cosine", o.min_view_cosine,
          "must be a cosine");
  check_not_negative("options.min_range_factor", o.min_range_factor);
  check_not_negative("options.max_range_factor", o.max_range_factor);
  check_not_negative("options.finer_octaves", o.finer_octaves);
  check_not_negative("options.coarser_octaves", o.coarser_octaves);
  check_positive("options.mono_chi2", o.mono_chi2);
  check_positive("options.stereo_chi2", o.stereo_chi2);
  check_correlation("options.stereo_correlation", o.stereo_correlation);
  check_not_negative("options.window_sigmas", o.window_sigmas);
  check_positive("options.max_radius", o.max_radius);
  require(o.max_distance >= 0 && o.max_distance < static_cast<double>(Descriptor::worst), "options.max_distance",
          o.max_distance, "must be a distance of the descriptor");
  require(o.max_ratio > 0 && o.max_ratio <= 1, "options.max_ratio", o.max_ratio, "must be in (0, 1]");
  require(!o.one_to_one || can_claim<Descriptor>, "options.one_to_one", o.one_to_one,
          "needs a descriptor whose distance_type has 32 bits");
  require(o.window_octave >= 0 && o.window_octave < o.scales.levels, "options.window_octave", o.window_octave,
          "must be a level of the pyramid");
}

/// Throws std::invalid_argument naming the array of the points that is missing.
template <class Descriptor>
void check_map_points(const map_point_view<Descriptor>& points, const projection_options& options) {
  require(points.count >= 0, "points.count", points.count, "must not be negative");
  if (points.count == 0) return;
  require(points.position != nullptr, "points.position", "null", "every point has a position");
  require(points.descriptor != nullptr, "points.descriptor", "null", "every point has a descriptor");
  require(points.normal != nullptr || !options.reads_normals(), "points.normal", "null",
          "needed unless options.min_view_cosine is -1 and options.oblique_factor 1");
  require(points.min_distance != nullptr || !options.range_gate, "points.min_distance", "null",
          "needed with options.range_gate");
  require(points.max_distance != nullptr || !options.range_gate, "points.max_distance", "null",
          "needed with options.range_gate");
}

/// Throws std::invalid_argument naming what is wrong with target number `i`.
template <class Descriptor, class Camera>
void check_projection_target(std::size_t i, const projection_target<Descriptor, Camera>& target, int point_count) {
  const argument_name name("targets", i);
  const auto demand = [&name](bool holds, const char* member, const auto& value, const char* rule) {
    if (!holds) reject(name + member, value, rule);
  };
  const keyframe_view<Descriptor, Camera>& v = target.view;
  check_pose(name, target.T_cw);
  check_keypoint_count(name, v);
  check_rig(name, v);
  demand(target.skip.empty() ||
             target.skip.size() == static_cast<std::size_t>(v.camera_count) * static_cast<std::size_t>(point_count),
         ".skip.size()", target.skip.size(), "must be 0 or the number of cameras times that of points");
  demand(target.taken.empty() || target.taken.size() == static_cast<std::size_t>(v.keypoint_count), ".taken.size()",
         target.taken.size(), "must be 0 or the number of keypoints");
  if (v.keypoint_count == 0) return;
  demand(v.pixel != nullptr && v.octave != nullptr && v.descriptor != nullptr, ".view", "null",
         "pixel, octave and descriptor are needed");
  const cell_index_view& c = v.cells;
  demand(c.bounds.max_x > c.bounds.min_x && c.bounds.max_y > c.bounds.min_y &&
             detail::is_finite(c.bounds.max_x - c.bounds.min_x) && detail::is_finite(c.bounds.max_y - c.bounds.min_y),
         ".view.cells.bounds", c.bounds.max_x - c.bounds.min_x,
         "the image must have a finite size, also without cells");
  if (c.columns == 0) return;
  demand(c.columns > 0 && c.rows > 0, ".view.cells.columns", c.columns, "a grid has columns and rows");
  demand(c.offsets.data != nullptr && c.keypoints.data != nullptr, ".view.cells", "null", "a grid has lists");
  demand(c.inverse_width > 0 && c.inverse_height > 0 && detail::is_finite(c.inverse_width) &&
             detail::is_finite(c.inverse_height),
         ".view.cells.inverse_width", c.inverse_width, "the size of a cell must be finite and positive");
}

/// Throws std::invalid_argument naming what is wrong with the targets; returns their cameras all together.
template <class Descriptor, class Camera>
std::size_t check_projection_targets(span<const projection_target<Descriptor, Camera>> targets, int point_count) {
  std::int64_t requests = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    check_projection_target(i, targets[i], point_count);
    requests += targets[i].view.camera_count;
    require(requests * (point_count > 0 ? point_count : 1) < (std::int64_t{1} << 31), "points x cameras of all targets",
            requests * point_count, "must be below 2^31 in one call");
  }
  return static_cast<std::size_t>(requests);
}

TURBOMAP_END_NAMESPACE
