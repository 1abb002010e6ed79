// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The views of one track while its point is made. A view that does not fit leaves the track; the others keep their order, that of
/// keyframes.

#include "../config.hpp"
#include "../context.hpp"
#include "creation_plan.hpp"
#include "place_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A view is named by its place in the list of all tracks.
template <class Descriptor, class Camera>
struct track_views {
  const track_creation_view<Descriptor, Camera>& tracks;  ///< all of them
  int begin, end;                                         ///< views of this one, those that have left too

  /// Takes all views for kept.
  template <class Workers>
  TURBOMAP_HD void keep(const Workers& workers) const {
    for (int i = begin + workers.number(); i < end; i += Workers::count) tracks.kept[i] = 1;
    workers.meet();
  }
  /// Measures all views.
  template <class Workers>
  TURBOMAP_HD void place(const Workers& workers) const {
    for (int i = begin + workers.number(); i < end; i += Workers::count) {
      const track_view& v = tracks.views[i];
      placed_view p{look_at(tracks.search.keyframes[v.keyframe], v.keypoint, tracks.search.sigma2), {}};
      const decision length = norm(p.seen.ray);  // 0: the pixel has no ray, and its error is the worst
      if (length > decision(0)) p.direction = transpose(camera(i).T_cw.R) * ((decision(1) / length) * p.seen.ray);
      tracks.placed_views[i] = p;
    }
    workers.meet();
  }
  /// The camera of view i, in the world.
  TURBOMAP_HD const placed_camera& camera(int i) const {
    return tracks.placed_cameras[tracks.views[i].keyframe * tracks.cameras + tracks.views[i].camera];
  }
  /// Its model.
  TURBOMAP_HD const Camera& model(int i) const {
    const track_view& v = tracks.views[i];
    return tracks.search.keyframes[v.keyframe].cameras[v.camera].camera;
  }
  /// The scale factor of its octave.
  TURBOMAP_HD decision scale(int i) const {
    const track_view& v = tracks.views[i];
    return decision(tracks.search.scale[tracks.search.keyframes[v.keyframe].octave[v.keypoint]]);
  }
  /// The next view that is left, from i on; `end`: none.
  TURBOMAP_HD int next(int i) const {
    while (i < end && tracks.kept[i] == 0) ++i;
    return i;
  }
  /// The first view that is left.
  TURBOMAP_HD int first() const { return next(begin); }
  /// Whether the views that are left are of as many keyframes as the options ask for. Views are in the order of keyframes.
  TURBOMAP_HD bool enough_keyframes() const {
    int count = 0, last = -1;
    for (int i = first(); i < end; i = next(i + 1)) {
      count += tracks.views[i].keyframe != last ? 1 : 0;
      last = tracks.views[i].keyframe;
    }
    return count >= tracks.options.fewest_keyframes;
  }
  /// `query` where view i is of the keyframe that is processed, else `neighbour`.
  TURBOMAP_HD creation_outcome of_view(int i, creation_outcome query, creation_outcome neighbour) const {
    return tracks.views[i].keyframe == 0 ? query : neighbour;
  }
};

}  // namespace detail

TURBOMAP_END_NAMESPACE
