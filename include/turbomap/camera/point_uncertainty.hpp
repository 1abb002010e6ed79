// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How well a point is known from the pixels that show it, and how far from its projection a pixel may therefore lie. A view
/// tells a point across its ray and, with u_right, along it; the views' information adds up, and its inverse is the point's
/// covariance Sigma. Seen from another camera, Sigma becomes an ellipse in the image: a pixel is compared with the projection
/// by sigma^2 I + J Sigma J^T instead of sigma^2 I. First-order propagation: Hartley and Zisserman, Multiple View Geometry,
/// 5.2.

#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/symmetric3.hpp"
#include "../types.hpp"
#include "project_with_derivative.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A point as one camera sees it.
template <class S>
struct projected_point {  ///< u, v in px
  vec2<S> pixel;
  S u_right;        ///< 0 without a right image
  S depth;          ///< m
  vec3<S> by_X[3];  ///< derivatives of u, v, u_right by the point in the world, px / m
};

/// Projects with derivatives. False where the camera does not see the point; with a right image also where depth <= 0.
/// \param T_cw  world to this camera   \param bf  px m; 0: no right image
template <class S, class Camera>
TURBOMAP_HD bool project_point(const Camera& camera, const isometry<S>& T_cw, const S& bf, const vec3<S>& X,
                               projected_point<S>& p) {
  const vec3<S> X_c = T_cw * X;
  mat23<S> d;
  if (!project_with_derivative(camera, X_c, p.pixel, d)) return false;
  p.depth = X_c.z;
  const mat3<S> R_wc = transpose(T_cw.R);
  p.by_X[0] = R_wc * vec3<S>{d(0, 0), d(0, 1), d(0, 2)};
  p.by_X[1] = R_wc * vec3<S>{d(1, 0), d(1, 1), d(1, 2)};
  p.by_X[2] = {S(0), S(0), S(0)};
  p.u_right = S(0);
  if (!(bf > S(0))) return true;
  if (!(X_c.z > S(0))) return false;
  const S disparity = bf / X_c.z;  // u_right = u - disparity
  p.u_right = p.pixel.x - disparity;
  p.by_X[2] = R_wc * vec3<S>{d(0, 0), d(0, 1), d(0, 2) + disparity / X_c.z};
  return true;
}

/// Adds what one view tells of the point: J^T N^-1 J, N the covariance of the errors of u, v and, if `stereo`, u_right.
/// \param sigma2  px^2, of each   \param correlation  of the errors of u and u_right, in [0, 1)
template <class S>
TURBOMAP_HD void add_information(symmetric3<S>& information, const projected_point<S>& p, bool stereo, const S& sigma2,
                                 const S& correlation) {
  const S w = S(1) / sigma2;
  add_outer(information, w, p.by_X[0]);
  add_outer(information, w, p.by_X[1]);
  if (stereo)  // what the error of u says about that of u_right is taken out
    add_outer(information, w / (S(1) - correlation * correlation), p.by_X[2] - correlation * p.by_X[0]);
}

/// The covariance of a point from the information of its views. One view without u_right, or rays that are parallel, leave the
/// distance open, and the sum singular: so it is known beforehand that a point lies within its own distance, as one standard
/// deviation in every direction. Beside the information of a pixel, (f / distance)^2 / sigma^2, that counts for nothing.
/// \param distance  m, of the farthest camera that sees the point; must not be 0
template <class S>
TURBOMAP_HD symmetric3<S> covariance_from(symmetric3<S> information, const S& distance) {
  const S least = S(1) / (distance * distance);
  add_to_diagonal(information, least);
  return inverse(information, least);
}

/// J Sigma J^T of rows u, v, u_right (or of any other three): px^2. Without u_right its first two rows.
template <class S>
TURBOMAP_HD symmetric3<S> projected_covariance(const symmetric3<S>& covariance, const vec3<S> (&by_X)[3]) {
  const vec3<S> u = covariance * by_X[0], v = covariance * by_X[1], r = covariance * by_X[2];
  return {dot(u, by_X[0]), dot(u, by_X[1]), dot(v, by_X[1]), dot(u, by_X[2]), dot(v, by_X[2]), dot(r, by_X[2])};
}

/// The Cholesky factor L of the covariance N + J Sigma J^T of the differences (u, v, u_right) between a keypoint and the
/// projection of a point that is not exact. solve_lower(L, e) whitens a difference e: its squared norm is the chi-square that
/// gates compare. Without u_right (not `stereo`) e.z is to be 0.
/// \param correlation  of the errors of u and u_right
template <class S>
TURBOMAP_HD symmetric3<S> spread_of_difference(const symmetric3<S>& projected, bool stereo, const S& sigma2,
                                               const S& correlation) {
  symmetric3<S> C = projected;
  if (!stereo) C.zx = C.zy = C.zz = S(0);
  add_to_diagonal(C, sigma2);
  if (!stereo) return cholesky(C, sigma2);
  C.zx = C.zx + correlation * sigma2;
  return cholesky(C, (S(1) - correlation * correlation) * sigma2);
}

TURBOMAP_END_NAMESPACE
