// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Map points from matches, decoupled from the search: it reads the result where the search left it, and gives a plan.

#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "correspondences.hpp"
#include "creation_plan.hpp"

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
  bool stereo;
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
    // cos(2 atan(b / d)) = (d^2 - b^2) / (d^2 + b^2), b = half the baseline; a depth of 0 gives -1, not 0 / 0
    const decision b = v.bf / decision(K.fx), b2 = b * b, d = v.depth + v.depth, d2 = d * d;
    v.parallax = (d2 - b2) / (d2 + b2);
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

}  // namespace detail

/// Index = result of the search: triangulates or back-projects one match and tests the point.
template <class Descriptor, class Camera>
struct create_point {
  search_view<Descriptor, Camera> search;
  creation_options options;
  created_point* points;  ///< [neighbour][slot]; written where there is a match

  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] == no_match) return;
    created_point p{};
    p.neighbour = i / search.slot_count;
    p.query = search.queries[i % search.slot_count];
    p.candidate = search.match[i];
    p.method = creation_method::none;
    p.outcome = create(p);
    points[i] = p;
  }

 private:
  TURBOMAP_HD creation_outcome create(created_point& p) const {
    const auto& a = search.query();
    const auto& b = search.neighbour(p.neighbour);
    const auto& camera_a = a.cameras[a.camera_of(p.query)];
    const auto& camera_b = b.cameras[b.camera_of(p.candidate)];
    const isometry<decision>& T_ba = search.pair(p.neighbour, a.camera_of(p.query), b.camera_of(p.candidate)).T_ba;
    const detail::creation_view va = detail::look_at(a, p.query, search.sigma2);
    const detail::creation_view vb = detail::look_at(b, p.candidate, search.sigma2);

    const vec3<decision> ray_a_in_b = T_ba.R * va.ray;
    const decision parallax = dot(ray_a_in_b, vb.ray) / (norm(ray_a_in_b) * norm(vb.ray));
    const decision stereo_parallax = va.parallax < vb.parallax ? va.parallax : vb.parallax;
    const isometry<decision> T_aw = camera_pose(camera_a, search.T_cw[0]);
    const isometry<decision> T_bw = camera_pose(camera_b, search.T_cw[1 + p.neighbour]);
    vec3<decision> X;  // the point in the world; the linear method depends on its frame, and this is the peer's
    if (parallax < stereo_parallax && parallax > decision(0) &&
        (va.stereo || vb.stereo || parallax < decision(options.max_parallax_cosine))) {
      p.method = creation_method::triangulated;
      if (!triangulate(T_aw, va.ray, T_bw, vb.ray, X, true)) return creation_outcome::at_infinity;
    } else if (va.stereo && va.parallax < vb.parallax) {
      p.method = creation_method::stereo_query;
      if (!(va.depth > decision(0))) return creation_outcome::no_depth;
      X = inverse(T_aw) * (va.depth * va.ray);
    } else if (vb.stereo && vb.parallax < va.parallax) {
      p.method = creation_method::stereo_neighbour;
      if (!(vb.depth > decision(0))) return creation_outcome::no_depth;
      X = inverse(T_bw) * (vb.depth * vb.ray);
    } else {
      return creation_outcome::low_parallax;
    }
    p.position = {X.x.value, X.y.value, X.z.value};

    const vec3<decision> X_a = T_aw * X, X_b = T_bw * X;
    if (!(X_a.z > decision(0))) return creation_outcome::behind_query;
    if (!(X_b.z > decision(0))) return creation_outcome::behind_neighbour;
    if (!detail::reprojects(camera_a.camera, X_a, va, options)) return creation_outcome::reprojection_query;
    if (!detail::reprojects(camera_b.camera, X_b, vb, options)) return creation_outcome::reprojection_neighbour;
    const decision distance_a = norm(X_a), distance_b = norm(X_b);
    if (distance_a == decision(0) || distance_b == decision(0)) return creation_outcome::zero_distance;
    if (options.max_distance > 0 &&
        (distance_a >= decision(options.max_distance) || distance_b >= decision(options.max_distance)))
      return creation_outcome::too_far;
    // A feature found s times farther away is found that many octaves finer.
    const decision ratio = distance_b / distance_a;
    const decision octaves = decision(search.scale[a.octave[p.query]]) / decision(search.scale[b.octave[p.candidate]]);
    const decision tolerance = decision(options.scale_tolerance) * decision(options.scales.scale_factor);
    if (ratio * tolerance < octaves || ratio > octaves * tolerance) return creation_outcome::scale;
    return creation_outcome::accepted;
  }
};

/// Candidate map points of one search. Make one and use it for every call. Move-only.
template <class Policy>
class point_creation {
 public:
  using memory_type = memory_of_t<Policy>;

  explicit point_creation(const context<Policy>& ctx) : points_(ctx.resource()) {}

  /// All matches with their outcome, in (neighbour, query keypoint) order, equal on every policy. Waits.
  /// \param matches  what create_points() was given, unchanged; throws std::invalid_argument when its size is another
  template <class Descriptor, class Camera>
  void plan(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches,
            std::vector<created_point>& result) const {
    const auto& search = matches.view();
    require(points_.size() ==
                static_cast<std::size_t>(search.neighbour_count) * static_cast<std::size_t>(search.slot_count),
            "matches", points_.size(), "are not what the points were made from");
    const std::int32_t* match = matches.on_host(ctx, search.match, host_match_);
    const created_point* points = matches.on_host(ctx, points_.data(), host_points_);
    ctx.synchronize();
    result.clear();
    const int count = search.neighbour_count * search.slot_count;
    for (int i = 0; i < count; ++i)
      if (match[i] != no_match) result.push_back(points[i]);
  }
  template <class Descriptor, class Camera>
  std::vector<created_point> plan(context<Policy>& ctx,
                                  const correspondences<Descriptor, Camera, Policy>& matches) const {
    std::vector<created_point> result;
    plan(ctx, matches, result);
    return result;
  }

 private:
  template <class D, class C, class P>
  friend void create_points(context<P>&, const correspondences<D, C, P>&, const creation_options&, point_creation<P>&);

  array<created_point, memory_type> points_;
  mutable std::vector<std::int32_t> host_match_;
  mutable std::vector<created_point> host_points_;
};

/// Creates and tests a point for every match [ORB-SLAM3]: triangulates where the rays of the two views have more parallax
/// than a stereo pair of either, else back-projects the stereo keypoint of larger parallax; accepts what lies before both
/// cameras, reprojects into both, and whose distances agree with the octaves. Decisions are equal on every policy.
/// \param matches  a search of this context; its keyframes must still be there
/// \param result   overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  an option is not finite or out of range, or the scale factor is not that of the
/// search
template <class Descriptor, class Camera, class Policy>
void create_points(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches,
                   const creation_options& options, point_creation<Policy>& result) {
  const auto finite = [](double value) { return detail::is_finite(value); };
  require(options.mono_chi2 > 0 && finite(options.mono_chi2), "options.mono_chi2", options.mono_chi2,
          "must be finite and positive");
  require(options.stereo_chi2 > 0 && finite(options.stereo_chi2), "options.stereo_chi2", options.stereo_chi2,
          "must be finite and positive");
  require(options.scales.scale_factor >= 1 && finite(options.scales.scale_factor), "options.scales.scale_factor",
          options.scales.scale_factor, "must be finite and at least 1");
  require(options.scale_tolerance >= 1 && finite(options.scale_tolerance), "options.scale_tolerance",
          options.scale_tolerance, "must be finite and at least 1");
  require(options.max_parallax_cosine <= 1, "options.max_parallax_cosine", options.max_parallax_cosine,
          "must be a cosine");
  require(options.max_distance >= 0 && finite(options.max_distance), "options.max_distance", options.max_distance,
          "must be finite and not negative");
  const auto& search = matches.view();
  const float searched = search.options.scales.scale_factor;
  if (options.scales.scale_factor != searched) {  // octaves would be compared by two rules
    const std::string rule = "must be that of the search, " + printed(searched);
    reject("options.scales.scale_factor", options.scales.scale_factor, rule.c_str());
  }
  const int count = search.neighbour_count * search.slot_count;
  result.points_.resize_discard(static_cast<std::size_t>(count));
  // The plan fetches all slots from a device in one copy: none may be left unwritten.
  if constexpr (std::is_same_v<memory_of_t<Policy>, device_memory>)
    fill_bytes(ctx.policy(), result.points_.data(), 0, static_cast<std::size_t>(count) * sizeof(created_point));
  for_each_index(ctx.policy(), count, create_point<Descriptor, Camera>{search, options, result.points_.data()});
}

TURBOMAP_END_NAMESPACE
