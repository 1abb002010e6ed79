// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One map point from one match: the position by triangulation of the two rays, or from the depth of a stereo keypoint, and
/// the tests that it has to pass [ORB-SLAM3].

#include "../config.hpp"
#include "../context.hpp"
#include "../prefetch.hpp"
#include "creation_plan.hpp"
#include "search_view.hpp"
#include "triangulation.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// One keypoint of a pair as creation sees it.
struct creation_view {
  vec2<decision> pixel;
  vec3<decision> ray;  ///< in its camera; z = 1 on straight images, else unit
  decision depth;      ///< m
  decision u_right;    ///< px
  decision bf;         ///< px m
  decision sigma2;     ///< px^2
  decision parallax;   ///< cosine of the parallax of its own stereo pair; 2: none
  bool stereo;         ///< has a u_right, and maybe a depth

  TURBOMAP_HD bool has_depth() const { return stereo && depth > decision(0); }
};

template <class Descriptor, class Camera>
TURBOMAP_HD creation_view look_at(const keyframe_view<Descriptor, Camera>& keyframe, int keypoint,
                                  const float* sigma2) {
  const auto& camera = keyframe.cameras[keyframe.camera_of(keypoint)];
  creation_view v{};
  v.pixel = cast<decision>(keyframe.pixel[keypoint]);
  v.sigma2 = decision(sigma2[keyframe.octave[keypoint]]);
  v.parallax = decision(2);
  pinhole<double> K;
  const bool straight = as_pinhole(camera.camera, K);
  v.ray = straight ? vec3<decision>{(v.pixel.x - decision(K.cx)) / decision(K.fx),
                                    (v.pixel.y - decision(K.cy)) / decision(K.fy), decision(1)}
                   : cast<decision>(keyframe.bearing[keypoint]);
  v.stereo = straight && camera.bf > 0 && keyframe.is_stereo(keypoint);
  if (v.stereo) {
    v.bf = decision(camera.bf);
    v.u_right = decision(keyframe.u_right[keypoint]);
    v.depth = keyframe.depth == nullptr ? decision(-1) : decision(keyframe.depth[keypoint]);
    // cos(2 atan(b / d)) = (d^2 - b^2) / (d^2 + b^2), b = half the baseline
    const decision b = v.bf / decision(K.fx), b2 = b * b, d = v.depth + v.depth, d2 = d * d;
    if (v.has_depth()) v.parallax = (d2 - b2) / (d2 + b2);
  }
  return v;
}

/// Reprojection error within the gate: two residuals, or three with u_right.
template <class Camera>
TURBOMAP_HD bool reprojects(const Camera& camera, const vec3<decision>& point, const creation_view& v,
                            const creation_options& options) {
  vec2<decision> p;
  if (!camera.project(point, p)) return false;
  const decision du = p.x - v.pixel.x, dv = p.y - v.pixel.y;
  if (!v.stereo) return du * du + dv * dv <= decision(options.mono_chi2) * v.sigma2;
  const decision dr = p.x - v.bf / point.z - v.u_right;
  return du * du + dv * dv + dr * dr <= decision(options.stereo_chi2) * v.sigma2;
}

/// One of two views that a point is made from.
template <class Camera>
struct pair_view {
  const creation_view& seen;
  const Camera& camera;
  const isometry<decision>& T_cw;
  decision scale;  ///< scale_factor^octave
};

/// The point of two views, if it passes the tests.
/// \param R_ba  rotation from camera a to camera b   \param p  method and position are set, as far as it comes
template <class Camera, class Point>
TURBOMAP_HD creation_outcome create_from_pair(const pair_view<Camera>& a, const pair_view<Camera>& b,
                                              const mat3<decision>& R_ba, const creation_options& options, Point& p) {
  const creation_view &va = a.seen, &vb = b.seen;
  const vec3<decision> ray_a_in_b = R_ba * va.ray;
  const decision parallax = dot(ray_a_in_b, vb.ray) / (norm(ray_a_in_b) * norm(vb.ray));
  const decision stereo_parallax = va.parallax < vb.parallax ? va.parallax : vb.parallax;
  vec3<decision> X;  // the point in the world; the linear method depends on its frame, and this is the peer's
  if (parallax < stereo_parallax && parallax > decision(0) &&
      (va.has_depth() || vb.has_depth() || parallax < decision(options.max_parallax_cosine))) {
    p.method = creation_method::triangulated;
    if (!triangulate(a.T_cw, va.ray, b.T_cw, vb.ray, X, true)) return creation_outcome::at_infinity;
  } else if (va.has_depth() && !(vb.parallax < va.parallax)) {
    p.method = creation_method::stereo_query;
    X = inverse(a.T_cw) * (va.depth * va.ray);
  } else if (vb.has_depth()) {
    p.method = creation_method::stereo_neighbour;
    X = inverse(b.T_cw) * (vb.depth * vb.ray);
  } else {
    return va.stereo || vb.stereo ? creation_outcome::no_depth : creation_outcome::low_parallax;
  }
  p.position = {X.x.value, X.y.value, X.z.value};

  const vec3<decision> X_a = a.T_cw * X, X_b = b.T_cw * X;
  if (!(X_a.z > decision(0))) return creation_outcome::behind_query;
  if (!(X_b.z > decision(0))) return creation_outcome::behind_neighbour;
  if (!reprojects(a.camera, X_a, va, options)) return creation_outcome::reprojection_query;
  if (!reprojects(b.camera, X_b, vb, options)) return creation_outcome::reprojection_neighbour;
  const decision distance_a = norm(X_a), distance_b = norm(X_b);
  if (distance_a == decision(0) || distance_b == decision(0)) return creation_outcome::zero_distance;
  if (options.max_distance > 0 &&
      (distance_a >= decision(options.max_distance) || distance_b >= decision(options.max_distance)))
    return creation_outcome::too_far;
  // A feature found s times farther away is found that many octaves finer.
  const decision ratio = distance_b / distance_a, octaves = a.scale / b.scale;
  const decision tolerance = decision(options.scale_tolerance) * decision(options.scales.scale_factor);
  if (ratio * tolerance < octaves || ratio > octaves * tolerance) return creation_outcome::scale;
  return creation_outcome::accepted;
}

/// Poses of cameras of a search.
struct computed_poses {
  /// Of one.
  template <class View, class Camera>
  TURBOMAP_HD isometry<decision> operator()(const View& search, int keyframe, const Camera& camera) const {
    return camera_pose(camera, search.T_cw[keyframe]);
  }
};
/// The same; the last ones of the query and of a neighbour are kept, as matches come neighbour by neighbour.
class kept_poses {
 public:
  /// Of one.
  template <class View, class Camera>
  TURBOMAP_HD const isometry<decision>& operator()(const View& search, int keyframe, const Camera& camera) {
    entry& e = last_[keyframe == 0 ? 0 : 1];
    if (e.keyframe != keyframe || e.camera != &camera)
      e = {keyframe, &camera, computed_poses{}(search, keyframe, camera)};
    return e.T_cw;
  }

 private:
  struct entry {
    int keyframe;
    const void* camera;
    isometry<decision> T_cw;
  };
  entry last_[2] = {{-1, nullptr, {}}, {-1, nullptr, {}}};
};

}  // namespace detail

/// Index = result of the search: triangulates or back-projects one match and tests the point.
template <class Descriptor, class Camera>
struct create_point {
  search_view<Descriptor, Camera> search;  ///< the matches
  creation_options options;                ///< thresholds
  created_point* points;                   ///< [neighbour][slot]; written where there is a match

  /// Asks memory for what the point of one match is made of, and for where it goes.
  void prefetch(int i) const {
    const auto ask = [](const auto& keyframe, int keypoint) {
      prefetch_line(keyframe.pixel + keypoint), prefetch_line(keyframe.octave + keypoint);
      if (keyframe.u_right != nullptr) prefetch_line(keyframe.u_right + keypoint);
      if (keyframe.depth != nullptr) prefetch_line(keyframe.depth + keypoint);
    };
    ask(search.query(), search.queries[i % search.slot_count]);
    ask(search.neighbour(i / search.slot_count), search.match[i]);
    prefetch_line(points + i);
  }
  /// Makes the point of one match.
  TURBOMAP_HD void operator()(int i) const {
    detail::computed_poses poses;
    if (search.match[i] != no_match) make(i, poses);
  }
  /// The same where there is a match. \param poses  of cameras of the search
  template <class Poses>
  TURBOMAP_HD void make(int i, Poses& poses) const {
    created_point p{};
    p.neighbour = i / search.slot_count;
    p.query = search.queries[i % search.slot_count];
    p.candidate = search.match[i];
    p.method = creation_method::none;
    p.outcome = create(p, poses);
    points[i] = p;
  }

 private:
  template <class Poses>
  TURBOMAP_HD creation_outcome create(created_point& p, Poses& poses) const {
    const auto& a = search.query();
    const auto& b = search.neighbour(p.neighbour);
    const auto& camera_a = a.cameras[a.camera_of(p.query)];
    const auto& camera_b = b.cameras[b.camera_of(p.candidate)];
    const mat3<decision>& R_ba = search.pair(p.neighbour, a.camera_of(p.query), b.camera_of(p.candidate)).T_ba.R;
    const detail::creation_view va = detail::look_at(a, p.query, search.sigma2);
    const detail::creation_view vb = detail::look_at(b, p.candidate, search.sigma2);
    const isometry<decision>& T_aw = poses(search, 0, camera_a);
    const isometry<decision>& T_bw = poses(search, 1 + p.neighbour, camera_b);
    return detail::create_from_pair<Camera>({va, camera_a.camera, T_aw, decision(search.scale[a.octave[p.query]])},
                                            {vb, camera_b.camera, T_bw, decision(search.scale[b.octave[p.candidate]])},
                                            R_ba, options, p);
  }
};

/// Index = run of results: the points of its matches. On the host, where a call per result costs more than to pass over those
/// without a match, and where the next matches can be asked for.
template <class Descriptor, class Camera>
struct create_point_run {
  static constexpr int length = 1024;    ///< results of a run
  create_point<Descriptor, Camera> one;  ///< of one result
  int count;                             ///< results of the search

  /// Makes the points of one run.
  void operator()(int run) const {
    constexpr int most = 16;
    int found[most], size = 0;
    detail::kept_poses poses;
    const auto create = [&] {
      for (int n = 0; n < size; ++n) one.make(found[n], poses);
      size = 0;
    };
    const int begin = run * length, end = count - begin < length ? count : begin + length;
    for_each_match(one.search.match, begin, end, [&](int i) {
      one.prefetch(i);
      found[size++] = i;
      if (size == most) create();
    });
    create();
  }
};

/// Creates the points of all matches of a search. A device also clears those without a match: cuda/create_points.cuh.
template <class Derived, class Descriptor, class Camera>
void launch_create_points(const thrust::execution_policy<Derived>& policy,
                          const search_view<Descriptor, Camera>& search, const creation_options& options,
                          created_point* points) {
  const int count = search.neighbour_count * search.slot_count, length = create_point_run<Descriptor, Camera>::length;
  for_each_index(derived(policy), count / length + (count % length != 0 ? 1 : 0),
                 create_point_run<Descriptor, Camera>{{search, options, points}, count});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/create_points.cuh"
#endif
