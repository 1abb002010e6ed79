// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Where the estimate of a track's point begins. Where two of its rays have enough parallax it is the point nearest to all rays, else
/// the depth that a stereo keypoint measured.

#include "../config.hpp"
#include "../context.hpp"
#include "../math/linear.hpp"
#include "../math/symmetric3.hpp"
#include "creation_plan.hpp"
#include "track_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// Whether a pair of rays has a parallax below 90 degrees whose cosine is below the limit, of this worker's share of pairs.
template <class Views, class Workers>
TURBOMAP_HD bool rays_suffice(const Views& views, const Workers& workers, const decision& limit) {
  for (int i = views.begin + workers.number(); i < views.end; i += Workers::count) {
    if (views.tracks.kept[i] == 0) continue;
    for (int j = views.next(i + 1); j < views.end; j = views.next(j + 1)) {
      const decision cosine = dot(views.tracks.placed_views[i].direction, views.tracks.placed_views[j].direction);
      if (cosine < limit && cosine > decision(0)) return true;
    }
  }
  return false;
}
/// The point whose squared distances to all rays have the least sum. Rays that suffice are not parallel.
template <class Views>
TURBOMAP_HD vec3<decision> nearest_to_rays(const Views& views) {
  symmetric3<decision> A;  // sum of I - d d^T
  vec3<decision> b{decision(0), decision(0), decision(0)};
  decision count(0);
  const vec3<decision> origin = views.camera(views.first()).centre;  // no digits are lost far from the world's
  for (int i = views.first(); i < views.end; i = views.next(i + 1)) {
    const vec3<decision> d = views.tracks.placed_views[i].direction, c = views.camera(i).centre - origin;
    add_outer(A, decision(-1), d);
    b = b + (c - dot(d, c) * d);
    count += decision(1);
  }
  add_to_diagonal(A, count);
  return origin + solve_positive(A, b);
}
/// The point nearest to all rays, if a pair of them has more parallax than a stereo pair of any view, else the back-projection
/// of the stereo view of largest parallax. False: neither is possible.
template <class Views, class Workers>
TURBOMAP_HD bool begin_track(const Views& views, const Workers& workers, creation_method& method, vec3<decision>& X) {
  method = creation_method::none;
  decision limit(2);
  int stereo = -1;
  for (int i = views.first(); i < views.end; i = views.next(i + 1)) {
    const creation_view& v = views.tracks.placed_views[i].seen;
    if (!v.has_depth() || !(v.parallax < limit)) continue;
    limit = v.parallax;
    stereo = i;
  }
  if (stereo < 0) limit = decision(views.tracks.options.max_parallax_cosine);
  if (workers.any(rays_suffice(views, workers, limit))) {
    method = creation_method::triangulated;
    X = nearest_to_rays(views);
    return true;
  }
  if (stereo < 0) return false;
  method = views.tracks.views[stereo].keyframe == 0 ? creation_method::stereo_query : creation_method::stereo_neighbour;
  const creation_view& v = views.tracks.placed_views[stereo].seen;
  X = inverse(views.camera(stereo).T_cw) * (v.depth * v.ray);
  return true;
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
