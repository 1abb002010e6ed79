// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One map point from all views of a track: it begins at the point nearest to all rays, or at the depth of a stereo keypoint
/// (begin_track.hpp says when), and is moved until the reprojection errors are least (fit_track.hpp). A view that does not fit
/// leaves the track, the worst one first, and the estimate is repeated. Where two views are left, it begins as a pair does and is
/// judged like one (create_point.hpp), so a track of two views is decided as a match is; two cameras of one keyframe are asked
/// besides whether something else looks as similar (lookalike.hpp).

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../prefetch.hpp"
#include "begin_track.hpp"
#include "create_point.hpp"
#include "fit_track.hpp"
#include "known_landmark.hpp"
#include "lookalike.hpp"
#include "place_views.hpp"
#include "track_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = track. \tparam Workers  who share a track; all hold the same values and take the same way
template <class Descriptor, class Camera, class Workers = detail::one_worker>
struct create_track {
  track_creation_view<Descriptor, Camera> tracks;  ///< the tracks

  /// Makes the point of track t by one thread of the host, and asks memory for what a later one is made of.
  void operator()(int t) const {
    constexpr int ahead = 4;
    if (t + ahead < tracks.track_count) prefetch(t + ahead);
    detail::view_fit fit;
    make(t, {&fit});
  }
  /// Makes the point of track t by several workers who share its views.
  TURBOMAP_HD void make(int t, const Workers& workers) const {
    created_track p{};
    p.method = creation_method::none;
    const views_type views{tracks, tracks.offsets[t], tracks.offsets[t + 1]};
    p.views = views.end - views.begin;
    views.keep(workers);
    if (!views.enough_keyframes()) {  // all workers say the same
      p.outcome = creation_outcome::too_few_keyframes;
    } else {
      const bool known =
          known_landmark<Descriptor, Camera>{tracks}(views.begin, views.end, workers.number(), Workers::count);
      p.outcome = workers.any(known) ? creation_outcome::known : create(views, workers, p);
      if (p.outcome == creation_outcome::accepted && !views.enough_keyframes())
        p.outcome = creation_outcome::too_few_keyframes;
      if (p.outcome == creation_outcome::accepted && p.views == 2 && is_lookalike(views, workers))
        p.outcome = creation_outcome::lookalike;
    }
    if (workers.number() == 0) tracks.points[t] = p;
  }

 private:
  using views_type = detail::track_views<Descriptor, Camera>;

  /// What the views of track t are measured by, and compared with.
  void prefetch(int t) const {
    for (int i = tracks.offsets[t]; i < tracks.offsets[t + 1]; ++i) {
      const track_view& v = tracks.views[i];
      const auto& keyframe = tracks.search.keyframes[v.keyframe];
      prefetch_line(keyframe.pixel + v.keypoint), prefetch_line(keyframe.octave + v.keypoint);
      prefetch_line(keyframe.bearing + v.keypoint);
      if (keyframe.u_right != nullptr) prefetch_line(keyframe.u_right + v.keypoint);
    }
  }

  /// Of the two views that are left: all workers say the same.
  TURBOMAP_HD bool is_lookalike(const views_type& views, const Workers& workers) const {
    const int a = views.first(), b = views.next(a + 1);
    const track_view &v = tracks.views[a], &w = tracks.views[b];
    if (v.keyframe != w.keyframe || !(tracks.options.lookalike_ratio > 0)) return false;
    return workers.any(lookalike<Descriptor, Camera>{tracks}(v, w, workers.number(), Workers::count));
  }
  /// One place refines, and there one compares: that is most of a kernel's code.
  TURBOMAP_HD creation_outcome create(const views_type& views, const Workers& workers, created_track& p) const {
    views.place(workers);
    for (;; --p.views) {
      const bool pair = p.views <= 2;
      vec3<decision> X;
      if (pair) {
        p.method = creation_method::none;
        const creation_outcome outcome = create_from_two(views, p);
        if (outcome != creation_outcome::accepted) return outcome;
        X = cast<decision>(p.position);
      } else if (!detail::begin_track(views, workers, p.method, X)) {
        return creation_outcome::low_parallax;
      }
      vec3<decision> refined = X;
      detail::track_fit start;
      const detail::track_fit f = detail::fit_track<views_type, Workers>{views, workers}.refine(refined, start);
      if (!f.behind && !(f.excess > decision(1))) return accept(f, refined, p);
      // A pair's point is better by the errors in pixels; if that costs a test, it stays.
      if (pair) return accept(start, X, p);
      if (workers.number() == 0) tracks.kept[f.worst] = 0;
      workers.meet();
    }
  }
  TURBOMAP_HD creation_outcome create_from_two(const views_type& views, created_track& p) const {
    const int a = views.first(), b = views.next(a + 1);
    const isometry<decision>&T_a = views.camera(a).T_cw, &T_b = views.camera(b).T_cw;
    const isometry<decision> T_ba = T_b * inverse(T_a);
    return detail::create_from_pair<Camera>({tracks.placed_views[a].seen, views.model(a), T_a, views.scale(a)},
                                            {tracks.placed_views[b].seen, views.model(b), T_b, views.scale(b)}, T_ba.R,
                                            tracks.options, p);
  }
  TURBOMAP_HD creation_outcome accept(const detail::track_fit& f, const vec3<decision>& X, created_track& p) const {
    p.position = {X.x.value, X.y.value, X.z.value};
    const double most = tracks.options.max_distance;
    if (most > 0 && f.farthest >= decision(most)) return creation_outcome::too_far;
    const symmetric3<decision> C = covariance_from(f.information, f.farthest);
    const auto number = [](decision x) { return static_cast<float>(x.value); };
    p.covariance = {number(C.xx), number(C.yx), number(C.yy), number(C.zx), number(C.zy), number(C.zz)};
    // Beyond some 1e19 m a variance is no float: nothing that reads it could use the point.
    const bool known = detail::is_finite(p.covariance.xx + p.covariance.yy + p.covariance.zz);
    return known ? creation_outcome::accepted : creation_outcome::at_infinity;
  }
};

/// Creates the points of all tracks.
template <class Derived, class Descriptor, class Camera>
void launch_create_tracks(const thrust::execution_policy<Derived>& policy,
                          const track_creation_view<Descriptor, Camera>& tracks) {
  for_each_index(derived(policy), tracks.track_count, create_track<Descriptor, Camera>{tracks});
}

TURBOMAP_END_NAMESPACE

#if TURBOMAP_HAS_CUDA
#include "cuda/create_tracks.cuh"
#endif
