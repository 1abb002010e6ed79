// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether what two cameras of one keyframe match may be two landmarks that look alike. Nearly any two rays of one epipolar plane meet
/// somewhere, and no third view contradicts. So each keypoint is compared with all that the other camera may see its landmark at:
/// one that looks nearly as similar as the match makes it ambiguous, as in Lowe's ratio test. The search cannot tell: it passes over
/// keypoints that have a map point, and over rays that are nearly parallel, which are right where the landmark is far away.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "epipolar.hpp"
#include "place_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Compares the two keypoints of a track with others of their keyframe.
template <class Descriptor, class Camera>
struct lookalike {
  const track_creation_view<Descriptor, Camera>& tracks;  ///< tracks and keyframes

  /// Whether another keypoint is nearly as similar to one of the two: their distance is not below options.lookalike_ratio times its.
  /// \param a,b           two views of one keyframe, by different cameras
  /// \param first,stride  compares with every stride-th keypoint only: several workers share them
  TURBOMAP_HD bool operator()(const track_view& a, const track_view& b, int first, int stride) const {
    const auto& keyframe = tracks.search.keyframes[a.keyframe];
    // A stereo keypoint has a depth that contradicts.
    if (keyframe.is_stereo(a.keypoint) || keyframe.is_stereo(b.keypoint)) return false;
    return has_rival(a, b, first, stride) || has_rival(b, a, first, stride);
  }

 private:
  /// Whether the camera of `match` has another keypoint that is as good for `view`. The same corner in another octave is no rival.
  TURBOMAP_HD bool has_rival(const track_view& view, const track_view& match, int first, int stride) const {
    const auto& keyframe = tracks.search.keyframes[view.keyframe];
    const auto& T_cw = tracks.search.T_cw[view.keyframe];
    const auto distance_to = [&](int k) {
      return decision(
          static_cast<double>(Descriptor::distance(keyframe.descriptor_of(view.keypoint), keyframe.descriptor_of(k))));
    };
    const decision distance = distance_to(match.keypoint),
                   ratio(detail::ratio_of<Descriptor>(tracks.options.lookalike_ratio));
    const pair_geometry g =
        make_pair_geometry(keyframe.cameras[view.camera], T_cw, keyframe.cameras[match.camera], T_cw, false);
    const query_epipolar q = make_query_epipolar(g, keyframe, view.keypoint);
    for (int k = first; k < keyframe.keypoint_count; k += stride)
      if (k != match.keypoint && keyframe.camera_of(k) == match.camera && !(distance < ratio * distance_to(k)) &&
          !are_beside(tracks, keyframe, k, match.keypoint) && may_match(g, q, keyframe, view.keypoint, k))
        return true;
    return false;
  }
  /// As in the search, but for rays that are nearly parallel.
  TURBOMAP_HD bool may_match(const pair_geometry& g, const query_epipolar& q,
                             const keyframe_view<Descriptor, Camera>& keyframe, int a, int b) const {
    const search_options& options = tracks.search.options;
    if (!g.straight &&
        dot(g.T_ba.R * q.ray, cast<decision>(keyframe.bearing[b])) > decision(options.max_parallax_cosine))
      return true;
    return epipolar_consistent(g, q, keyframe, a, keyframe, b, tracks.search.sigma2, tracks.search.scale, options);
  }
};

TURBOMAP_END_NAMESPACE
