// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pose of one frame from points that are held fixed: Levenberg and Marquardt's method on six unknowns, in rounds; after
/// each, observations that do not fit are told as outliers and the next round does without them. What an observation says is in
/// pose_observations.hpp. One frame is the work of a team (team_of_one.hpp).

#include <cstdint>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/rotation.hpp"
#include "../parallel.hpp"
#include "damping.hpp"
#include "motion_only_options.hpp"
#include "pose_observations.hpp"
#include "team_of_one.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = frame. \tparam Exact  as of pose_observations
template <class Camera, bool Exact>
struct adjust_one_pose {
  pose_observations<Camera, Exact> seen;  ///< observations of all frames, and options
  const rigid_transform<double>* guess;   ///< [frame] where it begins, T_cw
  const std::int32_t* begin;              ///< [frame + 1] first observation
  posed_frame* result;                    ///< [frame]
  std::uint8_t* outlier;                  ///< [observation]

  /// Frame f by one thread.
  TURBOMAP_HD void operator()(int f) const {
    team_of_one::memory memory;
    run(f, team_of_one{memory});
  }

  /// Frame f by a team; every member calls this.
  template <class Team>
  TURBOMAP_HD void run(int f, const Team& team) const {
    posed_frame r{guess[f], 0, 0, 0};
    if (!adjust(f, team, r)) {
      r = {guess[f], 0, 0, 0};
      if (begin[f + 1] - begin[f] >= seen.options.min_observations)
        for_each_of(f, team, [&](int i) { outlier[i] = counts(i) ? 1 : 0; });
    }
    if (team.rank == 0) result[f] = r;
  }

 private:
  static constexpr int triangle = 21, normal_equations = triangle + 6;
  static_assert(normal_equations < team_of_one::most);

  /// Calls g(i) for the observations of a frame that a member of the team has: the same ones each time.
  template <class Team, class Function>
  TURBOMAP_HD void for_each_of(int f, const Team& team, const Function& g) const {
    for (int i = begin[f] + team.rank; i < begin[f + 1]; i += team.size) g(i);
  }
  /// Whether an observation says anything: one of no information is neither an inlier nor an outlier.
  TURBOMAP_HD bool counts(int i) const { return seen.information[i] > 0; }

  /// False: the frame cannot be adjusted.
  template <class Team>
  TURBOMAP_HD bool adjust(int f, const Team& team, posed_frame& r) const {
    for_each_of(f, team, [&](int i) { outlier[i] = 0; });
    if (begin[f + 1] - begin[f] < seen.options.min_observations) return false;
    const rigid_transform<double> start = normalised(guess[f]);
    const double square = start.qx * start.qx + start.qy * start.qy + start.qz * start.qz + start.qw * start.qw;
    if (!(square > 0.5)) return false;  // no rotation: it could not be normalised
    for (int round = 0; round < seen.options.rounds; ++round) {
      const bool robust = round < seen.options.robust_rounds;
      // [ORB-SLAM3] starts every round at the first guess: a pose that outliers have dragged away does not matter then.
      r.T_cw = start;
      if (!optimise(f, team, robust, r.T_cw, r.cost)) return false;
      r.inliers = classify(f, team, r.T_cw);
      if (r.inliers < seen.options.min_observations) return false;
    }
    r.adjusted = 1;
    return true;
  }

  /// Where the rays of points that are not exact begin: the same for every pose that is tried, so that costs can be compared.
  TURBOMAP_HD vec3<double> rays_from(int f) const {
    if constexpr (Exact)
      return {};
    else
      return camera_centre(to_isometry<double>(normalised(guess[f])));
  }

  /// The normal equations of the inliers at a pose (lower triangle of H, b), and their cost: in one pass, since most steps are
  /// accepted.
  template <class Team>
  TURBOMAP_HD const double* linearise(int f, const Team& team, bool robust, const rigid_transform<double>& T_cw,
                                      int place) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    const vec3<double> from = rays_from(f);
    double sums[normal_equations + 1] = {};
    for_each_of(f, team, [&](int i) {
      if (outlier[i] != 0 || !counts(i)) return;
      double rho = 0;
      // What a step leaves undefined counts as 1000 px off.
      if (seen.template observe<true>(i, T, from, robust, sums, sums + triangle, rho) < 0)
        rho = 1e6 * seen.information[i];
      sums[normal_equations] += rho;
    });
    return team.sum(sums, place);
  }

  /// Levenberg-Marquardt on the inliers. False: the cost at the start is not finite.
  template <class Team>
  TURBOMAP_HD bool optimise(int f, const Team& team, bool robust, rigid_transform<double>& T_cw, double& best) const {
    int place = 0;
    const double* now = linearise(f, team, robust, T_cw, place);
    best = now[normal_equations];
    if (!detail::is_finite(best)) return false;
    damping_control control;
    for (int i = 0; i < 6; ++i)
      control.lambda = larger(control.lambda, seen.options.initial_lambda_scale * now[i * (i + 1) / 2 + i]);
    for (int iteration = 0; iteration < seen.options.iterations; ++iteration) {
      double x[6], predicted = 0;
      if (!team.solve(now, now + triangle, control.lambda, x)) {
        control.refuse();
        continue;
      }
      for (int i = 0; i < 6; ++i) predicted += x[i] * (control.lambda * x[i] + now[triangle + i]);
      const rigid_transform<double> moved = left_exp(x, T_cw);
      if (!(predicted > seen.options.min_predicted_decrease * best)) {
        if (seen.options.take_last_step && predicted > 0) T_cw = moved;
        return true;
      }
      const double* next = linearise(f, team, robust, moved, 1 - place);
      if (!control.accepts(best, next[normal_equations], predicted)) continue;
      best = next[normal_equations], T_cw = moved;
      now = next, place = 1 - place;
    }
    return true;
  }

  /// Tells outliers from all observations: beyond the gate, behind the camera, not defined. Returns how many are none.
  template <class Team>
  TURBOMAP_HD int classify(int f, const Team& team, const rigid_transform<double>& T_cw) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    const vec3<double> from = rays_from(f);
    double inliers[1] = {};
    for_each_of(f, team, [&](int i) {
      if (!counts(i)) {
        outlier[i] = 0;
        return;
      }
      const auto& c = seen.camera_of(i);
      double rho;
      const double chi2 = seen.template observe<false>(i, T, from, false, nullptr, nullptr, rho);
      const double depth = (c.T_camera_body * (T * seen.point[i])).z;
      const bool good = chi2 >= 0 && chi2 <= seen.gate(seen.is_stereo(i)) && (depth > 0 || !c.straight);
      outlier[i] = good ? 0 : 1;
      inliers[0] += good ? 1 : 0;
    });
    return static_cast<int>(*team.sum(inliers, 0));
  }
};

/// The poses of all frames.
template <class Derived, class Camera, bool Exact>
void launch_adjust_poses(const thrust::execution_policy<Derived>& policy, int frames,
                         const adjust_one_pose<Camera, Exact>& work) {
  for_each_index(derived(policy), frames, work);
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/adjust_poses.cuh"
#endif
