// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// New map points are on probation for a few keyframes: those that tracking does not find again, and those that no further
/// keyframe sees, are dropped [ORB-SLAM3].

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../error.hpp"

namespace turbomap {

/// Options of the probation. Defaults are those of [ORB-SLAM3].
struct map_point_culling_options {
  float min_found_ratio = 0.25F;  ///< found / visible in tracking below this: dropped
  int fewest_measurements = 3;    ///< so many or fewer (a stereo keypoint is two): dropped, after...
  int patience = 2;               ///< ...so many keyframes. 2 measurements where there is no stereo
  int probation = 3;              ///< keyframes after which a point is no longer looked at
};

/// Throws std::invalid_argument naming the option that is out of range.
inline void check(const map_point_culling_options& o) {
  require(o.min_found_ratio >= 0, "options.min_found_ratio", o.min_found_ratio, "must not be negative");
  require(o.patience >= 0, "options.patience", o.patience, "must not be negative");
  require(o.probation >= o.patience, "options.probation", o.probation, "must not be less than the patience");
}

/// A point on probation, and the keyframe it was made in, counted in keyframes that local mapping processed.
template <class Point>
struct recent_point {
  Point point;         ///< its name
  std::int64_t since;  ///< number of the keyframe
};

/// Whether a point fails. \param few  few(): whether it has `fewest_measurements` or fewer; asked only where that decides
/// \param age  keyframes since it was made
template <class Few>
bool fails_probation(float found_ratio, Few few, std::int64_t age, const map_point_culling_options& options) {
  return found_ratio < options.min_found_ratio || (age >= options.patience && few());
}

/// What one round did.
struct map_point_culling_summary {
  std::size_t dropped = 0;   ///< erased from the map
  std::size_t released = 0;  ///< probation is over
};

}  // namespace turbomap
