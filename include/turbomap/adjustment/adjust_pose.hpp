// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pose of one frame from points that are held fixed: Levenberg and Marquardt's method on six unknowns, in rounds; after
/// each, observations that do not fit are told as outliers and the next round does without them. Points that are not exact
/// count less along the directions in which they are not known. One frame is the work of a team: of one thread, of a block, or
/// of a cluster of blocks (cuda/adjust_poses.cuh), whose members share the observations and agree on all else.

#include <cmath>
#include <cstdint>

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../math/pack.hpp"
#include "../math/rotation.hpp"
#include "../parallel.hpp"
#include "adjustment_camera.hpp"
#include "damping.hpp"
#include "factor_derivatives.hpp"
#include "motion_only_options.hpp"
#include "reprojection.hpp"
#include "robust.hpp"
#include "small_cholesky.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A team of one thread. Members of a team compute the same but for the loops over observations, which they share.
struct team_of_one {
  /// @{
  /// Number of this member; number of members; the most numbers that are summed at once.
  static constexpr int rank = 0, size = 1, most = 28;
  /// @}
  /// What the members share.
  struct memory {
    double total[2][most];  ///< by place
  };
  memory& sums;  ///< where sums are kept

  /// The sums of numbers over the members, kept until the next ones at this place. \param place  0 or 1
  template <int N>
  TURBOMAP_HD const double* sum(const double (&x)[N], int place) const {
    for (int i = 0; i < N; ++i) sums.total[place][i] = x[i];
    return sums.total[place];
  }
  /// (H + lambda I) x = b. False: it has no solution.
  TURBOMAP_HD bool solve(const double* H, const double* b, double lambda, double (&x)[6]) const {
    double L[36];
    for (int i = 0, at = 0; i < 6; ++i)
      for (int j = 0; j <= i; ++j, ++at) L[i * 6 + j] = H[at] + (i == j ? lambda : 0);
    if (!factorise_small<6>(L)) return false;
    for (int i = 0; i < 6; ++i) x[i] = b[i];
    solve_lower<6>(L, x);
    solve_upper<6>(L, x);
    return true;
  }
};

/// Index = frame. \tparam Exact  points are: `covariance` and `spread` are not read
template <class Camera, bool Exact>
struct adjust_one_pose {
  const adjustment_camera<Camera>* cameras;  ///< of the rig
  const rigid_transform<double>* guess;      ///< [frame] where it begins, T_cw
  const std::int32_t* begin;                 ///< [frame + 1] first observation
  const vec3<double>* point;                 ///< [observation] world, m
  const vec3<double>* pixel;                 ///< [observation] u, v, u_right, px
  const double* information;                 ///< [observation] 1 / sigma^2, px^-2
  const std::uint8_t* camera;                ///< null: the first
  const point_covariance* covariance;        ///< [observation] of its point
  motion_only_options options;               ///< thresholds and rounds
  posed_frame* result;                       ///< [frame]
  std::uint8_t* outlier;                     ///< [observation]
  symmetric3<double>* spread;                ///< [observation] see weigh()

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
      if (begin[f + 1] - begin[f] >= options.min_observations) for_each_of(f, team, [&](int i) { outlier[i] = 1; });
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

  /// False: the frame cannot be adjusted.
  template <class Team>
  TURBOMAP_HD bool adjust(int f, const Team& team, posed_frame& r) const {
    for_each_of(f, team, [&](int i) { outlier[i] = 0; });
    if (begin[f + 1] - begin[f] < options.min_observations) return false;
    const rigid_transform<double> start = normalised(guess[f]);
    const double square = start.qx * start.qx + start.qy * start.qy + start.qz * start.qz + start.qw * start.qw;
    if (!(square > 0.5)) return false;  // no rotation: it could not be normalised
    if constexpr (!Exact) weigh(f, team, start);
    for (int round = 0; round < options.rounds; ++round) {
      const bool robust = round < options.robust_rounds;
      // [ORB-SLAM3] starts every round at the first guess: a pose that outliers have dragged away does not matter then.
      r.T_cw = start;
      if (!optimise(f, team, robust, r.T_cw, r.cost)) return false;
      if constexpr (!Exact) weigh(f, team, r.T_cw);
      r.inliers = classify(f, team, r.T_cw);
      if (r.inliers < options.min_observations) return false;
    }
    r.adjusted = 1;
    return true;
  }

  /// Where points are not exact: the covariance of each observation's residual, sigma^2 I + J Sigma J^T at this pose, as its
  /// Cholesky factor. Constant until the next pose of a round: the cost of a step can be compared with that before it.
  template <class Team>
  TURBOMAP_HD void weigh(int f, const Team& team, const rigid_transform<double>& T_cw) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    const mat3<double> R_wb = transpose(T.R);
    for_each_of(f, team, [&](int i) {
      lane_reprojection<double, double, 1> r{};
      vec3<pack<double, 1>> X;
      const bool stereo = project<true>(i, T, r, X);
      vec3<double> by_X[3] = {};
      if (r.defined.v[0] > 0)
        for (int k = 0; k < (stereo ? 3 : 2); ++k)
          by_X[k] = R_wb * vec3<double>{r.d[k][0].v[0], r.d[k][1].v[0], r.d[k][2].v[0]};
      spread[i] = spread_of_difference(projected_covariance(to_symmetric<double>(covariance[i]), by_X), stereo,
                                       1 / information[i], 0.0);
    });
  }

  /// The rows of an observation, and the point in body coordinates. Returns whether there is a third one.
  template <bool Derivative>
  TURBOMAP_HD bool project(int i, const isometry<double>& T, lane_reprojection<double, double, 1>& r,
                           vec3<pack<double, 1>>& X) const {
    using P = pack<double, 1>;
    const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
    const bool stereo = c.bf > 0 && pixel[i].z >= 0;
    X = transform(T, vec3<P>{P(point[i].x), P(point[i].y), P(point[i].z)});
    const vec3<P> z{P(pixel[i].x), P(pixel[i].y), P(stereo ? pixel[i].z : 0.0)};
    if (stereo)
      r.template compute<Derivative, true>(c, X, z);
    else
      r.template compute<Derivative, false>(c, X, z);
    return stereo;
  }

  /// Rows and derivatives of unit covariance, where points are not exact.
  template <bool Derivative>
  TURBOMAP_HD static void whiten(const symmetric3<double>& L, lane_reprojection<double, double, 1>& r) {
    const vec3<double> e = solve_lower(L, vec3<double>{r.e[0].v[0], r.e[1].v[0], r.e[2].v[0]});
    r.e[0].v[0] = e.x, r.e[1].v[0] = e.y, r.e[2].v[0] = e.z;
    for (int c = 0; Derivative && c < 3; ++c) {
      const vec3<double> d = solve_lower(L, vec3<double>{r.d[0][c].v[0], r.d[1][c].v[0], r.d[2][c].v[0]});
      r.d[0][c].v[0] = d.x, r.d[1][c].v[0] = d.y, r.d[2][c].v[0] = d.z;
    }
  }

  /// Huber's kernel; on a device by one reciprocal root instead of a root of a quotient.
  TURBOMAP_HD static void weigh_robustly(double delta2, double chi2, double& rho, double& weight) {
#if defined(__CUDA_ARCH__)
    if (!(chi2 > delta2)) return;
    weight = ::sqrt(delta2) * ::rsqrt(chi2);
    rho = (chi2 + chi2) * weight - delta2;
#else
    huber{delta2}(chi2, rho, weight);
#endif
  }

  /// chi2 of an observation, and, where asked for, its part of the normal equations. Negative: not defined.
  template <bool Derivative>
  TURBOMAP_HD double observe(int i, const isometry<double>& T, bool robust, double* H, double* b, double& rho) const {
    lane_reprojection<double, double, 1> r{};
    vec3<pack<double, 1>> X;
    const bool stereo = project<Derivative>(i, T, r, X);
    if (!(r.defined.v[0] > 0)) return -1;
    const int size = stereo ? 3 : 2;
    if constexpr (!Exact) whiten<Derivative>(spread[i], r);
    const double info = Exact ? information[i] : 1;
    double e[3], chi2 = 0, weight = 1;
    for (int k = 0; k < size; ++k) e[k] = r.e[k].v[0], chi2 += info * e[k] * e[k];
    rho = chi2;
    if (robust) weigh_robustly(stereo ? options.stereo_chi2 : options.mono_chi2, chi2, rho, weight);
    if constexpr (Derivative) {
      const double x = X.x.v[0], y = X.y.v[0], w = X.z.v[0];
      for (int k = 0; k < size; ++k) {
        const double d[3] = {r.d[k][0].v[0], r.d[k][1].v[0], r.d[k][2].v[0]};
        const double J[6] = {y * d[2] - w * d[1], w * d[0] - x * d[2], x * d[1] - y * d[0], d[0], d[1], d[2]};
        detail::add_normal_equations<1>(J, e + k, weight * info, 6, H, b);
      }
    }
    return chi2;
  }

  /// The normal equations of the inliers at a pose (lower triangle of H, b), and their cost: in one pass, since most steps are
  /// accepted.
  template <class Team>
  TURBOMAP_HD const double* linearise(int f, const Team& team, bool robust, const rigid_transform<double>& T_cw,
                                      int place) const {
    const isometry<double> T = to_isometry<double>(T_cw);
    double sums[normal_equations + 1] = {};
    for_each_of(f, team, [&](int i) {
      if (outlier[i] != 0) return;
      double rho = 0;
      // What a step leaves undefined counts as 1000 px off.
      if (observe<true>(i, T, robust, sums, sums + triangle, rho) < 0) rho = 1e6 * information[i];
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
      control.lambda = larger(control.lambda, options.initial_lambda_scale * now[i * (i + 1) / 2 + i]);
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      double x[6], predicted = 0;
      if (!team.solve(now, now + triangle, control.lambda, x)) {
        control.refuse();
        continue;
      }
      for (int i = 0; i < 6; ++i) predicted += x[i] * (control.lambda * x[i] + now[triangle + i]);
      const rigid_transform<double> moved = left_exp(x, T_cw);
      if (!(predicted > options.min_predicted_decrease * best)) {
        if (options.take_last_step && predicted > 0) T_cw = moved;
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
    double inliers[1] = {};
    for_each_of(f, team, [&](int i) {
      const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
      const bool stereo = c.bf > 0 && pixel[i].z >= 0;
      double rho;
      const double chi2 = observe<false>(i, T, false, nullptr, nullptr, rho);
      const double depth = (c.T_camera_body * (T * point[i])).z;
      const bool good =
          chi2 >= 0 && chi2 <= (stereo ? options.stereo_chi2 : options.mono_chi2) && (depth > 0 || !c.straight);
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
