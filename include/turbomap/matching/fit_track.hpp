// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How well a point fits the views of its track, and where it fits best: reprojection errors, weighed by their octaves, and the scale
/// at which each view found it; Gauss and Newton's method on them. Several workers may share the views: they project side by side,
/// and each adds all of it in the order of the views, so that the bits are those of one.

#include "../camera/point_uncertainty.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../math/symmetric3.hpp"
#include "create_point.hpp"
#include "track_views.hpp"

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

/// How a point fits the views that are left.
struct track_fit {
  symmetric3<decision> information;
  vec3<decision> descent;   ///< minus half the derivative of `cost` by the point
  decision cost;            ///< sum of squared errors / sigma2
  decision farthest;        ///< m, of the cameras
  int worst;                ///< the view with the largest error over its gate
  decision excess;          ///< that ratio; over 1: the view fails
  creation_outcome reason;  ///< what it fails in
  bool behind;              ///< the point is behind `worst`; nothing else is known then
};

/// \tparam Views  track_views   \tparam Workers  who share them
template <class Views, class Workers>
struct fit_track {
  const Views& views;      ///< those that are left count
  const Workers& workers;  ///< all hold the same values

  /// Moves X to where the errors are least, as far as the options let it, and says how it fits there.
  /// \param start  how it fits where it was
  TURBOMAP_HD track_fit refine(vec3<decision>& X, track_fit& start) const {
    track_fit f{};
    vec3<decision> moved = X;
    for (int step = 0;; ++step) {
      const track_fit g = compare(moved);
      if (step == 0) start = g;
      if (step > 0 && (g.behind || !(g.cost < f.cost))) break;
      X = moved;
      f = g;
      if (step >= options().refinement_steps || f.behind) break;
      const vec3<decision> move = solve_positive(f.information, f.descent);
      if (!(dot(f.descent, move) > decision(options().refinement_tolerance))) break;
      moved = X + move;
    }
    return f;
  }

 private:
  TURBOMAP_HD const creation_options& options() const { return views.tracks.options; }

  /// Reprojects into the views that are left. The scale is compared with the first of them, the query's where it is there.
  TURBOMAP_HD track_fit compare(const vec3<decision>& X) const {
    track_fit f{};
    f.descent = {decision(0), decision(0), decision(0)};
    f.cost = f.farthest = f.excess = decision(0);
    f.behind = false;
    const int first = views.first();
    const decision first_size = norm(X - views.camera(first).centre) * views.scale(first);
    for (int begin = first; begin < views.end; begin += Workers::count) {
      const int mine = begin + workers.number();
      const bool left = mine < views.end && views.tracks.kept[mine] != 0;
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
  TURBOMAP_HD void look(int i, const vec3<decision>& X, const decision& first_size, view_fit& fit) const {
    const creation_view& v = views.tracks.placed_views[i].seen;
    projected_point<decision> p;
    fit.seen = project_point(views.model(i), views.camera(i).T_cw, v.stereo ? v.bf : decision(0), X, p) &&
               p.depth > decision(0);
    if (!fit.seen) return;
    const creation_options& o = options();
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
    fit.distance = norm(X - views.camera(i).centre);
    const decision size = fit.distance * views.scale(i);
    fit.error = squared * w / decision(v.stereo ? o.stereo_chi2 : o.mono_chi2);
    fit.ratio = (size > first_size ? size / first_size : first_size / size) / tolerance;
  }
  /// \param e  the error   \param d  its derivative by the point
  TURBOMAP_HD static row_fit row(const decision& w, const decision& e, const vec3<decision>& d, const decision& cost) {
    row_fit r{};
    add_outer(r.information, w, d);
    r.descent = -(w * e) * d;
    r.cost = cost;
    return r;
  }
  /// Adds what a view says. False: the point is behind it.
  TURBOMAP_HD bool add(track_fit& f, const view_fit& of_view_i, int i, bool first) const {
    if (!of_view_i.seen) {
      f.worst = i;
      f.behind = true;
      f.reason = views.of_view(i, creation_outcome::behind_query, creation_outcome::behind_neighbour);
      return false;
    }
    for (int k = 0; k < (of_view_i.stereo ? 3 : 2); ++k) {
      const row_fit& r = of_view_i.rows[k];
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
      f.reason = by_scale
                     ? creation_outcome::scale
                     : views.of_view(i, creation_outcome::reprojection_query, creation_outcome::reprojection_neighbour);
    }
    return true;
  }
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
