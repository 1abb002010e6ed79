// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a correspondence search demands of its arguments, on the host before anything is changed.

#include <cstddef>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/number_checks.hpp"
#include "../span.hpp"
#include "../store/argument_checks.hpp"
#include "../store/posed_keyframe.hpp"
#include "search_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Throws std::invalid_argument naming the option that cannot be.
template <class Descriptor>
void check_search_options(const search_options& o) {
  require(o.max_distance >= 0 && o.max_distance < static_cast<double>(Descriptor::worst), "options.max_distance",
          o.max_distance, "must be a distance of the descriptor");
  check_scales(o.scales);
  check_positive("options.line_chi2", o.line_chi2);
  check_positive("options.reprojection_chi2", o.reprojection_chi2);
  require(o.epipole_radius >= 0, "options.epipole_radius", o.epipole_radius, "must not be negative");
  require(o.max_parallax_cosine <= 1, "options.max_parallax_cosine", o.max_parallax_cosine, "must be a cosine");
}

/// Throws std::invalid_argument naming what is wrong with a keyframe whose view is in `memory`.
template <class Memory, class Descriptor, class Camera>
void check_searched_keyframe(Memory memory, const argument_name& name, const posed_keyframe<Descriptor, Camera>& k) {
  check_pose(name, k.T_cw);
  check_keypoint_count(name, k.view);
  check_rig(name, k.view);
  if (!(k.has_point.empty() || k.has_point.size() == static_cast<std::size_t>(k.view.keypoint_count)))
    reject(name + ".has_point.size()", k.has_point.size(), "must be 0 or the number of keypoints");
  if (k.view.keypoint_count > 0 && (k.view.pixel == nullptr || k.view.bearing == nullptr || k.view.octave == nullptr ||
                                    k.view.descriptor == nullptr))
    reject(name + ".view", "null", "pixel, bearing, octave and descriptor are needed");
  check_cameras(memory, name, k.view);
}

/// Throws std::invalid_argument naming what is wrong with the arguments of a call.
template <class Policy, class Descriptor, class Camera>
void check_search(const context<Policy>&, const posed_keyframe<Descriptor, Camera>& query,
                  span<const posed_keyframe<Descriptor, Camera>> neighbours, const search_options& options) {
  const memory_of_t<Policy> memory;
  check_search_options<Descriptor>(options);
  check_searched_keyframe(memory, "query", query);
  for (std::size_t n = 0; n < neighbours.size(); ++n) check_searched_keyframe(memory, {"neighbours", n}, neighbours[n]);
}

TURBOMAP_END_NAMESPACE
