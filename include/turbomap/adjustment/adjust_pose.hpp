// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The pose of one frame from points that are held fixed: Levenberg and Marquardt's method on six unknowns, in rounds; after
/// each, observations that do not fit are told as outliers and the next round does without them. Points that are not exact
/// are unknowns too: at every pose each moves to where its covariance and its pixel agree best (uncertain_point.hpp). One
/// frame is the work of a team: of one thread, of a block, or of a cluster of blocks (cuda/adjust_poses.cuh), whose members
/// share the observations and agree on all else.

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
#include "uncertain_point.hpp"

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

/// Index = frame. \tparam Exact  points are: `covariance` is not read
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
    for (int round = 0; round < options.rounds; ++round) {
      const bool robust = round < options.robust_rounds;
      // [ORB-SLAM3] starts every round at the first guess: a pose that outliers have dragged away does not matter then.
      r.T_cw = start;
      if (!optimise(f, team, robust, r.T_cw, r.cost)) return false;
      r.inliers = classify(f, team, r.T_cw);
      if (r.inliers < options.min_observations) return false;
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

  /// The rows of an observation of a point in the world, and that point in body coordinates. Returns whether there is a third
  /// row.
  template <bool Derivative>
  TURBOMAP_HD bool project(int i, const isometry<double>& T, const vec3<double>& at,
                           lane_reprojection<double, double, 1>& r, vec3<pack<double, 1>>& X) const {
    using P = pack<double, 1>;
    const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
    const bool stereo = c.bf > 0 && pixel[i].z >= 0;
    X = transform(T, vec3<P>{P(at.x), P(at.y), P(at.z)});
    const vec3<P> z{P(pixel[i].x), P(pixel[i].y), P(stereo ? pixel[i].z : 0.0)};
    if (stereo)
      r.template compute<Derivative, true>(c, X, z);
    else
      r.template compute<Derivative, false>(c, X, z);
    return stereo;
  }

  /// The same of a point that is not exact, moved to where it agrees best with its pixel; rows and derivatives of unit
  /// covariance. With J by the point's step and C = sigma^2 I + J Sigma J^T, a step of Gauss and Newton for the point goes to
  /// -Sigma J^T C^-1 (e - J step), and the chi2 of its error and the pixel's together is that of e - J step by C.
  /// \param from  the centre of uncertain_point
  TURBOMAP_HD bool project_uncertain(int i, const isometry<double>& T, const vec3<double>& from,
                                     lane_reprojection<double, double, 1>& r, vec3<pack<double, 1>>& X) const {
    const mat3<double> R_wb = transpose(T.R);
    const symmetric3<double> Sigma = to_symmetric<double>(covariance[i]);
    uncertain_point x(point[i], from);
    for (int left = options.point_steps;; --left) {
      const bool stereo = project<true>(i, T, x.at(), r, X);
      if (!(r.defined.v[0] > 0)) return stereo;
      vec3<double> J[3] = {};
      for (int k = 0; k < (stereo ? 3 : 2); ++k)
        J[k] = x.by_step(R_wb * vec3<double>{r.d[k][0].v[0], r.d[k][1].v[0], r.d[k][2].v[0]});
      const symmetric3<double> L =
          spread_of_difference(projected_covariance(Sigma, J), stereo, 1 / information[i], 0.0);
      const auto whitened = [&](double u, double v, double w) { return solve_lower(L, vec3<double>{u, v, w}); };
      const vec3<double> e = whitened(r.e[0].v[0] - dot(J[0], x.step()), r.e[1].v[0] - dot(J[1], x.step()),
                                      stereo ? r.e[2].v[0] - dot(J[2], x.step()) : 0);
      if (left <= 0) {
        r.e[0].v[0] = e.x, r.e[1].v[0] = e.y, r.e[2].v[0] = e.z;
        for (int c = 0; c < 3; ++c) {
          const vec3<double> d = whitened(r.d[0][c].v[0], r.d[1][c].v[0], r.d[2][c].v[0]);
          r.d[0][c].v[0] = d.x, r.d[1][c].v[0] = d.y, r.d[2][c].v[0] = d.z;
        }
        return stereo;
      }
      const vec3<double> w = solve_upper(L, e), g = -w.x * J[0] - w.y * J[1] - w.z * J[2], step = Sigma * g;
      const double chi2 = dot(g, step), most = options.point_sigmas * options.point_sigmas;  // of the step alone
      x.go((chi2 > most ? std::sqrt(most / chi2) : 1) * step);
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
  /// \param from  as of project_uncertain()
  template <bool Derivative>
  TURBOMAP_HD double observe(int i, const isometry<double>& T, const vec3<double>& from, bool robust, double* H,
                             double* b, double& rho) const {
    lane_reprojection<double, double, 1> r{};
    vec3<pack<double, 1>> X;
    bool stereo;
    if constexpr (Exact)
      stereo = project<Derivative>(i, T, point[i], r, X), (void)from;
    else
      stereo = project_uncertain(i, T, from, r, X);
    if (!(r.defined.v[0] > 0)) return -1;
    const int size = stereo ? 3 : 2;
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
    const vec3<double> from = rays_from(f);
    double sums[normal_equations + 1] = {};
    for_each_of(f, team, [&](int i) {
      if (outlier[i] != 0) return;
      double rho = 0;
      // What a step leaves undefined counts as 1000 px off.
      if (observe<true>(i, T, from, robust, sums, sums + triangle, rho) < 0) rho = 1e6 * information[i];
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
    const vec3<double> from = rays_from(f);
    double inliers[1] = {};
    for_each_of(f, team, [&](int i) {
      const auto& c = cameras[camera == nullptr ? 0 : camera[i]];
      const bool stereo = c.bf > 0 && pixel[i].z >= 0;
      double rho;
      const double chi2 = observe<false>(i, T, from, false, nullptr, nullptr, rho);
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
