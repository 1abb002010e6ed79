// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The geometry of two views: what is computed once for a pair of cameras, and the test whether two keypoints can see the
/// same point. Decisions are taken in strict<double>: equal on every policy and under every compiler flag.

#include "../camera/camera_concept.hpp"
#include "../camera/rig.hpp"
#include "../config.hpp"
#include "../math/linear.hpp"
#include "../math/strict.hpp"
#include "../store/keyframe_view.hpp"
#include "search_options.hpp"
#include "triangulation.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Camera a of the query keyframe against camera b of a neighbour.
struct pair_geometry {
  isometry<decision> T_ba;  ///< camera a to camera b
  pinhole<double> K_a;      ///< of camera a, px; valid where `straight`
  pinhole<double> K_b;      ///< of camera b, px; valid where `straight`
  bool straight;            ///< both images are rectilinear: epipolar curves are lines in pixels
  bool guard_epipole;       ///< candidates near the epipole are refused (both keypoints without u_right)
  vec2<decision> epipole;   ///< of a in b, px; valid where guard_epipole
  vec3<float> baseline;     ///< unit vector from the centre of b to that of a, in b; 0 where there is none
  vec3<float> plane_x;      ///< across the baseline: angles of epipolar planes are measured from here
  vec3<float> plane_y;      ///< across both: angles grow towards here
};

/// A pose that maps world to camera k of a rig.
template <class Camera>
TURBOMAP_HD isometry<decision> camera_pose(const rig_camera<Camera>& camera, const rigid_transform<double>& T_cw) {
  return to_isometry<decision>(camera.T_camera_body) * to_isometry<decision>(T_cw);
}

/// \param guard  apply the epipole guard where the pair allows it
template <class Camera>
TURBOMAP_HD pair_geometry make_pair_geometry(const rig_camera<Camera>& a, const rigid_transform<double>& T_aw,
                                             const rig_camera<Camera>& b, const rigid_transform<double>& T_bw,
                                             bool guard) {
  pair_geometry g{};
  const isometry<decision> T_a = camera_pose(a, T_aw), T_b = camera_pose(b, T_bw);
  g.T_ba = T_b * inverse(T_a);
  g.straight = as_pinhole(a.camera, g.K_a) && as_pinhole(b.camera, g.K_b);

  vec3<decision>& t = g.T_ba.t;
  decision length = norm(t);
  // What is left of equal centres is rounding, whose direction means nothing.
  if (length <= decision(1e-12) * (norm(T_a.t) + norm(T_b.t))) {
    t = {decision(0), decision(0), decision(0)};
    length = decision(0);
  }
  // Behind the camera, too: the image of the line through both centres is the same point.
  g.guard_epipole = guard && g.straight && t.z != decision(0);
  if (g.guard_epipole)
    g.epipole = {decision(g.K_b.fx) * (t.x / t.z) + decision(g.K_b.cx),
                 decision(g.K_b.fy) * (t.y / t.z) + decision(g.K_b.cy)};
  if (length > decision(0)) {
    const vec3<decision> e = (decision(1) / length) * t;
    // Any vector not parallel to e completes the frame; the axis in which e is smallest is the safest.
    const decision x = abs(e.x), y = abs(e.y), z = abs(e.z);
    const decision one(1), zero(0);
    const vec3<decision> axis = x <= y && x <= z ? vec3<decision>{one, zero, zero}
                                : y <= z         ? vec3<decision>{zero, one, zero}
                                                 : vec3<decision>{zero, zero, one};
    const vec3<decision> u = cross(e, axis);
    const vec3<decision> px = (one / norm(u)) * u;
    const vec3<decision> py = cross(e, px);
    g.baseline = {float(e.x.value), float(e.y.value), float(e.z.value)};
    g.plane_x = {float(px.x.value), float(px.y.value), float(px.z.value)};
    g.plane_y = {float(py.x.value), float(py.y.value), float(py.z.value)};
  }
  return g;
}

/// What the test needs of a query keypoint for one pair: its epipolar line in b (straight images), or its ray.
struct query_epipolar {
  decision line_a;        ///< straight: the line a u + b v + c = 0 in b, u and v in px
  decision line_b;        ///< see line_a
  decision line_c;        ///< see line_a
  decision squared_norm;  ///< straight: line_a^2 + line_b^2
  vec3<decision> ray;     ///< curved: unit bearing in a
};

/// The line or the ray of one query keypoint.
template <class Descriptor, class Camera>
TURBOMAP_HD query_epipolar make_query_epipolar(const pair_geometry& g, const keyframe_view<Descriptor, Camera>& query,
                                               int keypoint) {
  query_epipolar q{};
  if (!g.straight) {
    q.ray = cast<decision>(query.bearing[keypoint]);
    return q;
  }
  const vec2<decision> uv = cast<decision>(query.pixel[keypoint]);
  const vec3<decision> x{(uv.x - decision(g.K_a.cx)) / decision(g.K_a.fx),
                         (uv.y - decision(g.K_a.cy)) / decision(g.K_a.fy), decision(1)};
  const vec3<decision> n = cross(g.T_ba.t, g.T_ba.R * x);  // normal of the epipolar plane, in b
  q.line_a = n.x / decision(g.K_b.fx);
  q.line_b = n.y / decision(g.K_b.fy);
  q.line_c = n.z - q.line_a * decision(g.K_b.cx) - q.line_b * decision(g.K_b.cy);
  q.squared_norm = q.line_a * q.line_a + q.line_b * q.line_b;
  return q;
}

/// Squared pixel distance between a keypoint and the projection of a point; false where it does not project.
template <class Camera>
TURBOMAP_HD bool squared_reprojection_error(const Camera& camera, const vec3<decision>& point,
                                            const vec2<decision>& pixel, decision& error) {
  vec2<decision> projected;
  if (!camera.project(point, projected)) return false;
  const decision du = projected.x - pixel.x, dv = projected.y - pixel.y;
  error = du * du + dv * dv;
  return true;
}

/// Can the two keypoints see one point? [TurboMap §IV-C], [ORB-SLAM3].
/// Straight images: (distance of the candidate to the epipolar line)^2 < line_chi2 sigma2(o_b).
/// Curved images: the rays are not parallel, their linear triangulation lies before both cameras and reprojects into both.
/// \param sigma2  table of scale_factor^(2 o), px^2
template <class Descriptor, class Camera>
TURBOMAP_HD bool epipolar_consistent(const pair_geometry& g, const query_epipolar& q,
                                     const keyframe_view<Descriptor, Camera>& a, int keypoint_a,
                                     const keyframe_view<Descriptor, Camera>& b, int keypoint_b, const float* sigma2,
                                     const float* scale, const search_options& options) {
  const vec2<decision> uv_b = cast<decision>(b.pixel[keypoint_b]);
  const int octave_b = b.octave[keypoint_b];
  if (g.guard_epipole && !a.is_stereo(keypoint_a) && !b.is_stereo(keypoint_b)) {
    const decision du = g.epipole.x - uv_b.x, dv = g.epipole.y - uv_b.y;
    const decision radius(options.epipole_radius);
    if (du * du + dv * dv < radius * radius * decision(scale[octave_b])) return false;
  }
  if (g.straight) {
    const decision d = q.line_a * uv_b.x + q.line_b * uv_b.y + q.line_c;
    // Also false for a degenerate pair: no baseline, no line.
    return d * d < decision(options.line_chi2) * decision(sigma2[octave_b]) * q.squared_norm;
  }
  const vec3<decision> ray_b = cast<decision>(b.bearing[keypoint_b]);
  // A pixel that no ray reaches has the bearing 0.
  if (!(squared_norm(q.ray) > decision(0)) || !(squared_norm(ray_b) > decision(0))) return false;
  const vec3<decision> ray_a_in_b = g.T_ba.R * q.ray;
  if (dot(ray_a_in_b, ray_b) > decision(options.max_parallax_cosine)) return false;
  isometry<decision> identity{};
  identity.R.m[0] = identity.R.m[4] = identity.R.m[8] = decision(1);
  vec3<decision> X;
  if (!triangulate(identity, q.ray, g.T_ba, ray_b, X)) return false;
  if (!(X.z > decision(0))) return false;
  const vec3<decision> X_b = g.T_ba * X;
  if (!(X_b.z > decision(0))) return false;
  const decision chi2(options.reprojection_chi2);
  decision error;
  if (!squared_reprojection_error(a.cameras[a.camera_of(keypoint_a)].camera, X, cast<decision>(a.pixel[keypoint_a]),
                                  error) ||
      !(error <= chi2 * decision(sigma2[a.octave[keypoint_a]])))
    return false;
  return squared_reprojection_error(b.cameras[b.camera_of(keypoint_b)].camera, X_b, uv_b, error) &&
         error <= chi2 * decision(sigma2[octave_b]);
}

TURBOMAP_END_NAMESPACE
