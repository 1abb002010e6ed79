// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes a keyframe is searched against, as plain data.

#include "../map/neighbourhood_options.hpp"
#include "../matching/neighbour_options.hpp"

namespace turbomap {

/// Options of neighbour_search.
struct neighbour_search_options {
  neighbourhood_options neighbourhood;  ///< which keyframes are near
  neighbour_options baseline_rule;      ///< which of them are far enough apart, where one camera must tell
  /// m: neighbours nearer than this are not searched; 0: monocular, the median depth decides.
  double stereo_baseline = 0;
  /// Note which points the keypoints see, for creation_options::known_views.
  bool number_points = true;
  /// The cameras of a rig are matched with each other too where points are made from tracks: see search_options. What both
  /// see becomes one point.
  bool across_rig = true;
};

}  // namespace turbomap
