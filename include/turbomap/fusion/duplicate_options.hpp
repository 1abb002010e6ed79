// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a duplicate search takes and gives, as plain data. It is a search by projection, with the words and the thresholds of
/// duplicates.

#include "projection_options.hpp"

namespace turbomap {

/// Options of find_duplicates(). Defaults are those of [ORB-SLAM3] and [TurboMap §IV-D].
struct duplicate_options {
  /// Of the keypoints.
  pyramid scales;
  double radius = 3;              ///< px at octave 0, grows with s^o: half the side of the square window
  double min_view_cosine = 0.5;   ///< of viewing ray and normal: 60 degrees. -1: any; normals may then be null
  double min_range_factor = 0.8;  ///< a point is looked for from min_range_factor * min_distance ...
  double max_range_factor = 1.2;  ///< ... to max_range_factor * max_distance (both products in float)
  double mono_chi2 = 5.99;        ///< gate of reprojection error^2 / sigma2, two residuals: 95 %, 2 dof
  double stereo_chi2 = 7.8;       ///< the same with u_right, three residuals: 95 %, 3 dof
  int finer_octaves = 1;          ///< candidates are keypoints from so many octaves below the predicted one ...
  int coarser_octaves = 0;        ///< ... to so many above. 1 and 0 [ORB-SLAM3]: see local_mapper_options::accurate()
  double max_distance = 50;       ///< largest descriptor distance of a duplicate (50 of 256 bits: TH_LOW)
  bool range_gate = true;    ///< false: the distance range neither gates nor predicts the octave (ranges may be null),
                             ///< every octave is a candidate, the window is that of window_octave
  int window_octave = 0;     ///< without range_gate; in [0, levels)
  bool keep_trials = false;  ///< keep the outcome of every (target, camera, point), not only the matches

  /// The same rules as those of a search by projection: every point passes the gate, and several may find one keypoint.
  operator projection_options() const {
    projection_options o;
    o.scales = scales;
    o.radius = radius, o.oblique_factor = 1;
    o.min_view_cosine = min_view_cosine;
    o.min_range_factor = min_range_factor, o.max_range_factor = max_range_factor;
    o.range_gate = range_gate, o.window_octave = window_octave;
    o.finer_octaves = finer_octaves, o.coarser_octaves = coarser_octaves;
    o.gate = projection_gate::all, o.mono_chi2 = mono_chi2, o.stereo_chi2 = stereo_chi2;
    o.window_sigmas = 0;
    o.max_distance = max_distance, o.max_ratio = 1;
    o.one_to_one = false, o.keep_trials = keep_trials;
    return o;
  }
};

/// A keyframe in which duplicates are looked for.
template <class Descriptor, class Camera>
using duplicate_target = projection_target<Descriptor, Camera>;
/// A point and a keypoint of another view of it.
template <class Distance>
using duplicate = projection_match<Distance>;
/// The full story of one point in one camera of one target.
template <class Distance>
using duplicate_trial = projection_trial<Distance>;
/// What became of one point in one camera of one target.
using duplicate_outcome = projection_outcome;

}  // namespace turbomap
