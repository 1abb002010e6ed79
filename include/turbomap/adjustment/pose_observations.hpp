// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What one observation of a point says of the pose that it was made from: its error, and its part of the normal equations. A point that
/// is not exact is an unknown too: at every pose it moves to where its covariance and its pixel agree best (uncertain_point.hpp).

#include <cmath>
#include <cstdint>

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../math/pack.hpp"
#include "../math/rotation.hpp"
#include "adjustment_camera.hpp"
#include "factor_derivatives.hpp"
#include "motion_only_options.hpp"
#include "reprojection.hpp"
#include "robust.hpp"
#include "uncertain_point.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = observation. \tparam Exact  points are: `covariance` is not read
template <class Camera, bool Exact>
struct pose_observations {
  const adjustment_camera<Camera>* cameras;  ///< of the rig
  const vec3<double>* point;                 ///< world, m
  const vec3<double>* pixel;                 ///< u, v, u_right, px
  const double* information;                 ///< 1 / sigma^2, px^-2
  const std::uint8_t* camera;                ///< null: the first
  const point_covariance* covariance;        ///< of its point
  motion_only_options options;               ///< of the whole adjustment: the rounds and steps too

  /// The camera of an observation.
  TURBOMAP_HD const adjustment_camera<Camera>& camera_of(int i) const {
    return cameras[camera == nullptr ? 0 : camera[i]];
  }
  /// Whether it has a third row.
  TURBOMAP_HD bool is_stereo(int i) const { return camera_of(i).bf > 0 && pixel[i].z >= 0; }
  /// What the chi2 of an observation may be.
  TURBOMAP_HD double gate(bool stereo) const { return stereo ? options.stereo_chi2 : options.mono_chi2; }

  /// chi2 of an observation, and, where asked for, its part of the normal equations. Negative: not defined.
  /// \param from  where the ray of a point that is not exact begins: the centre of uncertain_point
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
    if (robust) weigh_robustly(gate(stereo), chi2, rho, weight);
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

 private:
  /// The rows of an observation of a point in the world, and that point in body coordinates. Returns whether there is a third
  /// row.
  template <bool Derivative>
  TURBOMAP_HD bool project(int i, const isometry<double>& T, const vec3<double>& at,
                           lane_reprojection<double, double, 1>& r, vec3<pack<double, 1>>& X) const {
    using P = pack<double, 1>;
    const auto& c = camera_of(i);
    const bool stereo = is_stereo(i);
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
  /// \param from  as of observe()
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
};

TURBOMAP_END_NAMESPACE
