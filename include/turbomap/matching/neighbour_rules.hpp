// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which neighbours a new keyframe is searched against: the caller's rules of [ORB-SLAM3], for callers who want them.

#include <cmath>
#include <cstddef>

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "../math/linear.hpp"
#include "../plain_sort.hpp"
#include "../span.hpp"
#include "../types.hpp"
#include "neighbour_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Distance between the centres of two keyframes, m. Poses here map world to camera: where the body is not the camera, T_camera_body
/// times T_cw.
inline double baseline(const rigid_transform<double>& T_aw, const rigid_transform<double>& T_bw) {
  return norm(camera_centre(to_isometry<double>(T_aw)) - camera_centre(to_isometry<double>(T_bw)));
}

/// With stereo depth: is there more parallax to win than the stereo pair itself has?
/// \param stereo_baseline  m, of the stereo pair or rig
inline bool baseline_suffices_stereo(const rigid_transform<double>& T_aw, const rigid_transform<double>& T_bw,
                                     double stereo_baseline) {
  return !(baseline(T_aw, T_bw) < stereo_baseline);
}

/// Monocular: does the baseline stand in proportion to the scene?
/// \param median_depth  median depth (m) of the neighbour's map points, see median_depth(); <= 0 or NaN: no
inline bool baseline_suffices_monocular(const rigid_transform<double>& T_aw, const rigid_transform<double>& T_bw,
                                        double median_depth, const neighbour_options& options = {}) {
  return median_depth > 0 && !(baseline(T_aw, T_bw) / median_depth < options.min_baseline_depth_ratio);
}

/// Median depth (m) of world points in a keyframe: element floor((n - 1) / 2) of the sorted depths. -1 without points. Not
/// finite depths are left out. `depths` is scratch that is reused. O(n).
template <class List>
double median_depth(const rigid_transform<double>& T_cw, span<const vec3<double>> points, List& depths) {
  const isometry<double> T = to_isometry<double>(T_cw);
  depths.clear();
  for (const vec3<double>& p : points) {
    const double z = (T * p).z;
    if (detail::is_finite(z)) depths.push_back(z);
  }
  if (depths.empty()) return -1;
  return select_plain(depths.data(), depths.size(), (depths.size() - 1) / 2);
}

TURBOMAP_END_NAMESPACE
