// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One map point from all views of a track: the point nearest to all rays, moved until the reprojection errors are least
/// (Gauss-Newton). A view that does not fit leaves the track, the worst one first, and the estimate is repeated. Where two
/// views are left, they are judged like a pair (create_point.hpp), so a track of two views is decided as a match is.

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "create_point.hpp"
#include "known_landmark.hpp"
#include "place_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// What a row of a view's projection (u, v or u_right) adds to a fit.
struct row_fit {
  symmetric3<decision> information;
  vec3<decision> descent;
  decision cost;
};
/// How a point fits one view. Views are looked at in any order; what they add is added in theirs.
struct view_fit {
  row_fit rows[3];
  decision distance;  ///< m, of the camera
  decision error;     ///< over its gate
  decision ratio;     ///< of the scale's, over its tolerance
  bool seen;          ///< in front of the camera; nothing else is known where not
  bool stereo;
};

/// One thread makes a point by itself. A warp shares the views of a track: cuda/create_tracks.cuh.
struct one_worker {
  static constexpr int count = 1;
  view_fit* fits;  ///< room for one view per worker

  TURBOMAP_HD int number() const { return 0; }
  TURBOMAP_HD bool any(bool of_mine) const { return of_mine; }
  /// Bit k: what worker k says.
  TURBOMAP_HD unsigned all(bool of_mine) const { return of_mine ? 1 : 0; }
  /// The least k of those that said so; there is one.
  TURBOMAP_HD int first(unsigned) const { return 0; }
  /// All see what was written before.
  TURBOMAP_HD void meet() const {}
};

}  // namespace detail

/// Index = track. \tparam Workers  who share a track; all hold the same values and take the same way
template <class Descriptor, class Camera, class Workers = detail::one_worker>
struct create_track {
  track_creation_view<Descriptor, Camera> tracks;  ///< the tracks

  /// Makes the point of track t by one thread.
  TURBOMAP_HD void operator()(int t) const {
    detail::view_fit fit;
    make(t, {&fit});
  }
  /// Makes the point of track t by several workers who share its views.
  TURBOMAP_HD void make(int t, const Workers& workers) const {
    created_track p{};
    p.method = creation_method::none;
    const range views{tracks.offsets[t], tracks.offsets[t + 1]};
    p.views = views.end - views.begin;
    if (!enough_keyframes(views)) {  // all workers say the same
      p.outcome = creation_outcome::too_few_keyframes;
    } else {
      const bool known =
          known_landmark<Descriptor, Camera>{tracks}(views.begin, views.end, workers.number(), Workers::count);
      p.outcome = workers.any(known) ? creation_outcome::known : create(views, workers, p);
      if (p.outcome == creation_outcome::accepted && !enough_keyframes(views))
        p.outcome = creation_outcome::too_few_keyframes;
    }
    if (workers.number() == 0) tracks.points[t] = p;
  }

 private:
  struct range {
    int begin, end;
  };
  /// How a point fits the views that are left.
  struct fit {
    symmetric3<decision> information;
    vec3<decision> descent;   ///< minus half the derivative of `cost` by the point
    decision cost;            ///< sum of squared errors / sigma2
    decision farthest;        ///< m, of the cameras
    int worst;                ///< the view with the largest error over its gate
    decision excess;          ///< that ratio; over 1: the view fails
    creation_outcome reason;  ///< what it fails in
    bool behind;              ///< the point is behind `worst`; nothing else is known then
  };

  TURBOMAP_HD const detail::placed_camera& camera(int i) const {
    return tracks.placed_cameras[tracks.views[i].keyframe * tracks.cameras + tracks.views[i].camera];
  }
  TURBOMAP_HD const Camera& model(int i) const {
    const track_view& v = tracks.views[i];
    return tracks.search.keyframes[v.keyframe].cameras[v.camera].camera;
  }
  TURBOMAP_HD decision scale(int i) const {
    const track_view& v = tracks.views[i];
    return decision(tracks.search.scale[tracks.search.keyframes[v.keyframe].octave[v.keypoint]]);
  }
  /// The next view that is left, from i on; views.end: none.
  TURBOMAP_HD int next(const range& views, int i) const {
    while (i < views.end && tracks.kept[i] == 0) ++i;
    return i;
  }
  /// Whether the views that are left are of as many keyframes as the options ask for. Views are in the order of keyframes.
  TURBOMAP_HD bool enough_keyframes(const range& views) const {
    int count = 0, last = -1;
    for (int i = next(views, views.begin); i < views.end; i = next(views, i + 1)) {
      count += tracks.views[i].keyframe != last ? 1 : 0;
      last = tracks.views[i].keyframe;
    }
    return count >= tracks.options.fewest_keyframes;
  }
  TURBOMAP_HD creation_outcome of_view(int i, creation_outcome query, creation_outcome neighbour) const {
    return tracks.views[i].keyframe == 0 ? query : neighbour;
  }

  /// One place refines, and there one compares: that is most of a kernel's code.
  TURBOMAP_HD creation_outcome create(const range& views, const Workers& workers, created_track& p) const {
    for (;; --p.views) {
      const bool pair = p.views <= 2;
      vec3<decision> X;
      if (pair) {
        p.method = creation_method::none;
        const int a = next(views, views.begin), b = next(views, a + 1);
        const creation_outcome outcome = create_from_two(a, b, p);
        if (outcome != creation_outcome::accepted) return outcome;
        X = cast<decision>(p.position);
      } else if (!begin(views, workers, p.method, X)) {
        return creation_outcome::low_parallax;
      }
      vec3<decision> refined = X;
      fit start;
      const fit f = refine(views, workers, refined, start);
      if (!f.behind && !(f.excess > decision(1))) return accept(f, refined, p);
      // A pair's point is better by the errors in pixels; if that costs a test, it stays.
      if (pair) return accept(start, X, p);
      if (workers.number() == 0) tracks.kept[f.worst] = 0;
      workers.meet();
    }
  }
  TURBOMAP_HD creation_outcome create_from_two(int a, int b, created_track& p) const {
    const isometry<decision> T_ba = camera(b).T_cw * inverse(camera(a).T_cw);
    return detail::create_from_pair<Camera>({tracks.placed_views[a].seen, model(a), camera(a).T_cw, scale(a)},
                                            {tracks.placed_views[b].seen, model(b), camera(b).T_cw, scale(b)}, T_ba.R,
                                            tracks.options, p);
  }
  TURBOMAP_HD creation_outcome accept(const fit& f, const vec3<decision>& X, created_track& p) const {
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

  /// Where the estimate begins: the point nearest to all rays, if a pair of them has more parallax than a stereo pair of any
  /// view, else the back-projection of the stereo view of largest parallax. False: neither is possible.
  TURBOMAP_HD bool begin(const range& views, const Workers& workers, creation_method& method, vec3<decision>& X) const {
    method = creation_method::none;
    decision limit(2);
    int stereo = -1;
    for (int i = next(views, views.begin); i < views.end; i = next(views, i + 1)) {
      const detail::creation_view& v = tracks.placed_views[i].seen;
      if (!v.stereo || !(v.depth > decision(0)) || !(v.parallax < limit)) continue;
      limit = v.parallax;
      stereo = i;
    }
    if (stereo < 0) limit = decision(tracks.options.max_parallax_cosine);
    if (workers.any(rays_suffice(views, workers, limit))) {
      method = creation_method::triangulated;
      X = nearest_to_rays(views);
      return true;
    }
    if (stereo < 0) return false;
    method = tracks.views[stereo].keyframe == 0 ? creation_method::stereo_query : creation_method::stereo_neighbour;
    const detail::creation_view& v = tracks.placed_views[stereo].seen;
    X = inverse(camera(stereo).T_cw) * (v.depth * v.ray);
    return true;
  }
  /// Whether a pair of rays has a parallax below 90 degrees whose cosine is below the limit, of this worker's share of pairs.
  TURBOMAP_HD bool rays_suffice(const range& views, const Workers& workers, const decision& limit) const {
    for (int i = views.begin + workers.number(); i < views.end; i += Workers::count) {
      if (tracks.kept[i] == 0) continue;
      for (int j = next(views, i + 1); j < views.end; j = next(views, j + 1)) {
        const decision cosine = dot(tracks.placed_views[i].direction, tracks.placed_views[j].direction);
        if (cosine < limit && cosine > decision(0)) return true;
      }
    }
    return false;
  }
  /// The point whose squared distances to all rays have the least sum. Rays that suffice are not parallel.
  TURBOMAP_HD vec3<decision> nearest_to_rays(const range& views) const {
    symmetric3<decision> A;  // sum of I - d d^T
    vec3<decision> b{decision(0), decision(0), decision(0)};
    decision count(0);
    const vec3<decision> origin = camera(next(views, views.begin)).centre;  // no digits are lost far from the world's
    for (int i = next(views, views.begin); i < views.end; i = next(views, i + 1)) {
      const vec3<decision> d = tracks.placed_views[i].direction, c = camera(i).centre - origin;
      add_outer(A, decision(-1), d);
      b = b + (c - dot(d, c) * d);
      count += decision(1);
    }
    add_to_diagonal(A, count);
    return origin + solve(A, b);
  }

  /// A x = b for a positive definite A. One that is singular but for rounding gives a step that no test lets pass.
  TURBOMAP_HD static vec3<decision> solve(const symmetric3<decision>& A, const vec3<decision>& b) {
    return inverse(A, decision(detail::epsilon<decision>::value) * (A.xx + A.yy + A.zz)) * b;
  }

  /// Moves X to where the errors are least, as far as the options let it, and says how it fits there.
  /// \param start  how it fits where it was
  TURBOMAP_HD fit refine(const range& views, const Workers& workers, vec3<decision>& X, fit& start) const {
    fit f{};
    vec3<decision> moved = X;
    for (int step = 0;; ++step) {
      const fit g = compare(views, workers, moved);
      if (step == 0) start = g;
      if (step > 0 && (g.behind || !(g.cost < f.cost))) break;
      X = moved;
      f = g;
      if (step >= tracks.options.refinement_steps || f.behind) break;
      const vec3<decision> move = solve(f.information, f.descent);
      if (!(dot(f.descent, move) > decision(tracks.options.refinement_tolerance))) break;
      moved = X + move;
    }
    return f;
  }

  /// Reprojects into the views that are left. The scale is compared with the first of them, the query's where it is there.
  TURBOMAP_HD fit compare(const range& views, const Workers& workers, const vec3<decision>& X) const {
    fit f{};
    f.descent = {decision(0), decision(0), decision(0)};
    f.cost = f.farthest = f.excess = decision(0);
    f.behind = false;
    const int first = next(views, views.begin);
    const decision first_size = norm(X - camera(first).centre) * scale(first);
    for (int begin = first; begin < views.end; begin += Workers::count) {
      const int mine = begin + workers.number();
      const bool left = mine < views.end && tracks.kept[mine] != 0;
      workers.meet();  // what was in `fits` has been read
      if (left) look(mine, X, first_size, workers.fits[workers.number()]);
      unsigned looked_at = workers.all(left);
      workers.meet();
      for (; looked_at != 0; looked_at &= looked_at - 1) {
        const int k = workers.first(looked_at);
        if (!add(f, workers.fits[k], begin + k, begin + k == first)) return f;
      }
    }
    return f;
  }
  /// One view's part of compare().
  TURBOMAP_HD void look(int i, const vec3<decision>& X, const decision& first_size, detail::view_fit& fit) const {
    const detail::creation_view& v = tracks.placed_views[i].seen;
    projected_point<decision> p;
    fit.seen = project_point(model(i), camera(i).T_cw, v.stereo ? v.bf : decision(0), X, p) && p.depth > decision(0);
    if (!fit.seen) return;
    const creation_options& o = tracks.options;
    const decision correlation(o.stereo_correlation), one(1);
    const decision tolerance = decision(o.scale_tolerance) * decision(o.scales.scale_factor);
    const decision du = p.pixel.x - v.pixel.x, dv = p.pixel.y - v.pixel.y, w = one / v.sigma2;
    decision squared = du * du + dv * dv;
    fit.rows[0] = row(w, du, p.by_X[0], w * squared);
    fit.rows[1] = row(w, dv, p.by_X[1], decision(0));
    fit.stereo = v.stereo;
    if (v.stereo) {  // what the error of u says about that of u_right is taken out
      const decision dr = p.u_right - v.u_right, e = dr - correlation * du;
      const decision wr = w / (one - correlation * correlation);
      squared += dr * dr;
      fit.rows[2] = row(wr, e, p.by_X[2] - correlation * p.by_X[0], wr * (e * e));
    }
    // A feature found s times farther away is found that many octaves finer: distance times scale is its size.
    fit.distance = norm(X - camera(i).centre);
    const decision size = fit.distance * scale(i);
    fit.error = squared * w / decision(v.stereo ? o.stereo_chi2 : o.mono_chi2);
    fit.ratio = (size > first_size ? size / first_size : first_size / size) / tolerance;
  }
  /// \param e  the error   \param d  its derivative by the point
  TURBOMAP_HD static detail::row_fit row(const decision& w, const decision& e, const vec3<decision>& d,
                                         const decision& cost) {
    detail::row_fit r{};
    add_outer(r.information, w, d);
    r.descent = -(w * e) * d;
    r.cost = cost;
    return r;
  }
  /// Adds what a view says. False: the point is behind it.
  TURBOMAP_HD bool add(fit& f, const detail::view_fit& of_view_i, int i, bool first) const {
    if (!of_view_i.seen) {
      f.worst = i;
      f.behind = true;
      f.reason = of_view(i, creation_outcome::behind_query, creation_outcome::behind_neighbour);
      return false;
    }
    for (int k = 0; k < (of_view_i.stereo ? 3 : 2); ++k) {
      const detail::row_fit& r = of_view_i.rows[k];
      f.information = f.information + r.information;
      f.descent = f.descent + r.descent;
      f.cost += r.cost;
    }
    const decision &error = of_view_i.error, &ratio = of_view_i.ratio;
    if (of_view_i.distance > f.farthest) f.farthest = of_view_i.distance;
    if (error > f.excess || ratio > f.excess || first) {
      const bool by_scale = ratio > error;
      f.worst = i;
      f.excess = by_scale ? ratio : error;
      f.reason = by_scale ? creation_outcome::scale
                          : of_view(i, creation_outcome::reprojection_query, creation_outcome::reprojection_neighbour);
    }
    return true;
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
