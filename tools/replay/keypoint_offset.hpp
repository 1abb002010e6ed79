// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the keypoints of a recording lie: in the full image, or at the pixel of their pyramid level times the level's scale,
/// which is off by up to 1.3 px (turbomap::in_full_image). A recording need not say so, but its observations tell: one point
/// seen at several levels fits better where the offset is taken off. Keypoints are moved by alpha times that offset, and the
/// alpha that fits best is estimated with its standard deviation, all poses and points free. It is 0 or 1 but for noise.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/io/recording.hpp>

#include "batch_bound.hpp"
#include "error_parts.hpp"

namespace turbomap_replay {

struct keypoint_offset_options {
  /// The first of the recording: enough for a sigma of a few hundredths, mapped in a second.
  std::size_t keyframes = 60;
  /// So many sigmas alpha has to be above 1/2, which chance does once in 30,000 recordings, and may be above 3/2 at most.
  double sigmas = 4;
};

/// alpha of a recording. See above.
struct keypoint_offset {
  double alpha = 0, sigma = 0;  ///< both 0: cannot be estimated, e.g. where no point is seen at two levels
  std::size_t observations = 0;
  bool multiplied = false;  ///< clearly nearer to 1: keypoints have to be moved to the full image

  nlohmann::json json() const {
    return {{"alpha", alpha}, {"sigma", sigma}, {"observations", observations}, {"multiplied", multiplied}};
  }
};

/// The keypoint moved by alpha times what in_full_image() moves it.
inline turbomap::keypoint partly_in_full_image(const turbomap::keypoint& k, const turbomap::recording_meta& meta,
                                               float alpha) {
  turbomap::keypoint moved = turbomap::in_full_image(k, meta.width, meta.height, meta.scale_factor);
  moved.x = k.x + alpha * (moved.x - k.x), moved.y = k.y + alpha * (moved.y - k.y);
  if (k.u_right >= 0) moved.u_right = k.u_right + alpha * (moved.u_right - k.u_right);
  return moved;
}

/// alpha where the costs of the best fits at 0, 1/2 and 1 are these: least + curvature (alpha - best)^2. The residuals' own
/// size scales its standard deviation. Not estimated where the parabola has no least place or goes below 0 there, as no sum
/// of squares does.
/// \param freedom  residuals less unknowns, above 0
inline keypoint_offset offset_of_costs(const double (&cost)[3], double freedom, std::size_t observations,
                                       const keypoint_offset_options& options = {}) {
  keypoint_offset found;
  found.observations = observations;
  const double curvature = 2 * (cost[0] - 2 * cost[1] + cost[2]);
  if (!(curvature > 0) || !std::isfinite(curvature)) return found;
  const double alpha = (1 - (cost[2] - cost[0]) / curvature) / 2;
  const double least = cost[0] - curvature * alpha * alpha;
  if (!(least > 0)) return found;
  found.alpha = alpha, found.sigma = std::sqrt(least / freedom / curvature);
  const double margin = options.sigmas * found.sigma;
  found.multiplied = alpha - 0.5 > margin && alpha < 1.5 + margin;
  return found;
}

/// Estimates alpha from the observations of a map of the recording's first keyframes, built with the keypoints as recorded.
/// The cost of the best fit is a parabola in alpha, since the offset is small against everything else that is not linear:
/// three fits, at 0, 1/2 and 1, give its least place and its curvature. O(three adjustments of all these keyframes). An
/// observation whose chi-square is large was left out by the map under alpha = 0, which draws the estimate towards 0, not
/// away from it. Not estimated where a fit fails, or where a level of the pyramid is less than a pixel, which has no offset.
/// \param T_cw, alive  by keyframe of the recording; keyframes that are not in the map are not alive
template <class Camera, class Policy>
keypoint_offset estimate_keypoint_offset(const turbomap::recording& recording, const Policy& policy,
                                         const map_observations& map,
                                         const std::vector<turbomap::rigid_transform<double>>& T_cw,
                                         const std::vector<std::uint8_t>& alive, double stereo_correlation,
                                         const keypoint_offset_options& options = {}) {
  keypoint_offset found;
  const turbomap::recording_meta& meta = recording.meta;
  const double coarsest = std::pow(static_cast<double>(meta.scale_factor), meta.levels - 1);
  if (!(turbomap::plain_detail::side_of_level(std::min(meta.width, meta.height), coarsest) >= 1)) return found;
  std::vector<std::size_t> views(map.points.size(), 0);
  for (const std::int32_t p : map.point) ++views[static_cast<std::size_t>(p)];
  std::vector<std::int32_t> number(views.size(), -1);
  std::vector<turbomap::vec3<double>> points;
  for (std::size_t p = 0; p < views.size(); ++p)
    if (views[p] >= 3) number[p] = static_cast<std::int32_t>(points.size()), points.push_back(map.points[p]);
  std::vector<std::vector<turbomap::keypoint>> keypoints;
  std::vector<std::uint8_t> fixed;
  std::size_t free_frames = 0;
  for (std::size_t i = 0; i < T_cw.size(); ++i) {
    keypoints.push_back(recording.gather_keypoints(i));
    fixed.push_back(alive[i] == 0 || std::count(alive.begin(), alive.begin() + static_cast<std::ptrdiff_t>(i), 1) == 0);
    free_frames += fixed[i] == 0 ? 1 : 0;
  }
  // Kernels as those of local adjustment: chi-square, 95 %.
  const row_weights weights{stereo_correlation, 5.991, 7.815};
  double cost[3];
  std::size_t residuals = 0;
  for (int step = 0; step < 3; ++step) {
    true_observations moved;
    moved.T_cw = T_cw, moved.points = points;
    residuals = 0;
    for (std::size_t r = 0; r < map.frame.size(); ++r) {
      const std::int32_t point = number[static_cast<std::size_t>(map.point[r])];
      if (point < 0) continue;
      const auto& k = keypoints[static_cast<std::size_t>(map.frame[r])][static_cast<std::size_t>(map.keypoint[r])];
      moved.add(recording, map.frame[r], partly_in_full_image(k, meta, 0.5F * static_cast<float>(step)), point);
      residuals += k.u_right >= 0 ? 3 : 2;
    }
    found.observations = moved.frame.size();
    if (residuals <= 3 * points.size() + 6 * free_frames + 1) return found;
    const fitted_poses fitted = adjust_observations<Camera>(recording, policy, moved, fixed, weights);
    if (fitted.end == turbomap::adjustment_end::singular || fitted.end == turbomap::adjustment_end::not_finite)
      return found;
    cost[step] = fitted.cost;
  }
  const double freedom = static_cast<double>(residuals - 3 * points.size() - 6 * free_frames);
  return offset_of_costs(cost, freedom, found.observations, options);
}

}  // namespace turbomap_replay
