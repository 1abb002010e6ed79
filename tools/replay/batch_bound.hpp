// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How well the poses of a simulated recording can be known at all: one bundle adjustment of every keyframe, with every
/// observation that is true by the simulator's ids and none that is wrong, begun at the truth. A map that is built from
/// the same keypoints cannot be expected to come nearer, though one may by chance: its trajectory error is what a replay's is
/// compared with.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/adjustment/problem.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/math/scale_table.hpp>

#include "arguments.hpp"
#include "recorded_keyframes.hpp"

namespace turbomap_replay {

/// The true observations of a simulated recording, one row per keypoint that shows a scene point seen twice or more, in
/// whatever cameras and keyframes.
struct true_observations {
  std::vector<turbomap::rigid_transform<double>> T_cw;  ///< true poses, one per keyframe
  std::vector<turbomap::vec3<double>> points;           ///< true positions
  std::vector<std::int32_t> frame, landmark;
  std::vector<turbomap::vec3<double>> pixel;
  std::vector<double> information;  ///< px^-2, by octave
  std::vector<std::uint8_t> camera;

  void add(const turbomap::recording& recording, std::int32_t keyframe, const turbomap::keypoint& z,
           std::int32_t point) {
    frame.push_back(keyframe), landmark.push_back(point);
    pixel.push_back({static_cast<double>(z.x), static_cast<double>(z.y), static_cast<double>(z.u_right)});
    information.push_back(1 / static_cast<double>(recording.meta.level_sigma2[z.octave]));
    camera.push_back(z.camera);
  }
};

inline true_observations gather_true_observations(const turbomap::recording& recording) {
  true_observations all;
  std::vector<std::int32_t> seen(recording.sim_point_xyz.size(), 0), number(seen.size(), -1);
  for (const std::int32_t p : recording.sim_point_id)
    if (p >= 0) ++seen[static_cast<std::size_t>(p)];
  for (std::size_t p = 0; p < seen.size(); ++p) {
    if (seen[p] < 2) continue;
    number[p] = static_cast<std::int32_t>(all.points.size());
    all.points.push_back(turbomap::cast<double>(recording.sim_point_xyz[p]));
  }
  for (std::size_t i = 0; i < recording.keyframe_count(); ++i) {
    all.T_cw.push_back(turbomap::cast<double>(recording.sim_T_cw_true[i]));
    const auto keypoints = recording.gather_keypoints(i);
    for (std::size_t k = 0; k < keypoints.size(); ++k) {
      const std::int32_t p = recording.sim_point_id[recording.keypoints(i).begin + k];
      if (p < 0 || number[static_cast<std::size_t>(p)] < 0) continue;
      all.add(recording, static_cast<std::int32_t>(i), keypoints[k], number[static_cast<std::size_t>(p)]);
    }
  }
  return all;
}

/// The point that has the most observations of those that the first keyframe with observations sees; 0 where there are none.
inline std::size_t most_seen_by_first(const true_observations& all) {
  if (all.frame.empty()) return 0;
  const std::int32_t first = *std::min_element(all.frame.begin(), all.frame.end());
  std::vector<std::size_t> seen(all.points.size(), 0);
  for (const std::int32_t p : all.landmark) ++seen[static_cast<std::size_t>(p)];
  std::size_t best = 0, most = 0;
  for (std::size_t row = 0; row < all.frame.size(); ++row) {
    const auto p = static_cast<std::size_t>(all.landmark[row]);
    if (all.frame[row] == first && seen[p] > most) most = seen[p], best = p;
  }
  return best;
}

/// What adjust_observations() finds.
struct fitted_poses {
  std::vector<turbomap::rigid_transform<double>> T_cw;  ///< one per keyframe
  double cost = 0;                                      ///< the sum of squares of the whitened residuals that is left
  turbomap::adjustment_end end = turbomap::adjustment_end::no_observations;  ///< why the fit ended: it may have failed
};

/// How rows are weighed: as the simulator drew them, or as adjustments of a map do.
struct row_weights {
  double stereo_correlation = 0;
  double mono_delta2 = 1e300, stereo_delta2 = 1e300;  ///< Huber's; 1e300: plain least squares
};

/// Poses that fit observations best: least squares, every row with the sigma of its octave, from the poses and points that
/// are given. In a monocular world, whose scale nobody knows, one point is held: align such poses with scale.
/// O(observations + keyframes^3) at most; 0.1 s for 40 keyframes.
/// \param fixed  by keyframe: not 0 where the pose is held, at least one
template <class Camera, class Policy>
fitted_poses adjust_observations(const turbomap::recording& recording, const Policy& policy,
                                 const true_observations& all, const std::vector<std::uint8_t>& fixed,
                                 const row_weights& weights) {
  const auto rig = recorded_rig<Camera>(recording.meta);
  turbomap::reprojections<Camera> rows;
  rows.rig = {rig.data(), static_cast<int>(rig.size())};
  rows.frame = all.frame, rows.landmark = all.landmark;
  rows.pixel = all.pixel, rows.information = all.information, rows.camera = all.camera;
  rows.stereo_correlation = weights.stereo_correlation;
  rows.mono_kernel.delta2 = weights.mono_delta2, rows.stereo_kernel.delta2 = weights.stereo_delta2;
  std::vector<std::uint8_t> held(all.points.size(), 0);
  if (recording.meta.sensor == "monocular" && !held.empty()) held[most_seen_by_first(all)] = 1;

  turbomap::adjustment_options options;
  options.numbers = turbomap::precision::float64;
  options.solver = turbomap::reduced_solver::sparse;
  options.damping = turbomap::damping_rule::diagonal;  // near and far points: half the iterations
  options.max_iterations = 100;                        // three without gain end it before
  options.min_relative_decrease = 1e-7;
  turbomap::context<Policy> ctx(policy);
  turbomap::bundle_problem<Policy, turbomap::pose_frame, turbomap::reprojections<Camera>> problem(ctx);
  problem.assign(ctx, {all.T_cw, fixed}, {all.points, held}, rows);
  fitted_poses fitted;
  const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, options);
  fitted.cost = summary.cost_final, fitted.end = summary.end;
  problem.frames(ctx, fitted.T_cw);
  return fitted;
}

/// Poses of the batch adjustment, from the truth; the first is held.
template <class Camera, class Policy>
std::vector<turbomap::rigid_transform<double>> batch_poses(const turbomap::recording& recording, const Policy& policy) {
  const true_observations all = gather_true_observations(recording);
  std::vector<std::uint8_t> fixed(all.T_cw.size(), 0);
  if (!fixed.empty()) fixed[0] = 1;
  return adjust_observations<Camera>(recording, policy, all, fixed, {simulated_correlation(recording.meta)}).T_cw;
}

}  // namespace turbomap_replay
