// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether the map has a point of a track's landmark already. Detectors find one corner in several octaves: one of these keypoints
/// sees the corner's point, the others see none and match each other. A point made of them is a duplicate from the start,
/// and would be merged, lose their keypoints, and be made again with the next keyframe.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../store/keypoint_window.hpp"
#include "place_views.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Looks for a point of the map that keypoints beside the views of a track see.
template <class Descriptor, class Camera>
struct known_landmark {
  const track_creation_view<Descriptor, Camera>& tracks;  ///< tracks, and the map points that keyframes see

  /// Whether options.known_views keypoints beside the track's views see one point of the map.
  /// \param begin,end     the views of the track
  /// \param first,stride  begins at every stride-th of them only: several workers share them
  TURBOMAP_HD bool operator()(int begin, int end, int first, int stride) const {
    const int wanted = tracks.options.known_views;
    if (tracks.map_points == nullptr || wanted <= 0) return false;
    for (int i = begin + first; wanted <= end - i; i += stride) {
      asked_in_others ask{*this, i, end, wanted, false};
      visit_beside(i, ask);
      if (ask.found) return true;
    }
    return false;
  }

 private:
  /// Visits keypoints near a view: of those that are beside it and see a point, calls found(point) until that is true.
  template <class Found>
  struct beside {
    const known_landmark& self;
    int view;
    Found& found;

    TURBOMAP_HD bool operator()(int keypoint) const {
      const track_view& v = self.tracks.views[view];
      const std::int32_t point = self.tracks.map_points[self.tracks.map_point_offset[v.keyframe] + keypoint];
      if (point < 0) return false;
      const auto& keyframe = self.tracks.search.keyframes[v.keyframe];
      const int apart = keyframe.octave[v.keypoint] - keyframe.octave[keypoint];
      if (apart > self.tracks.options.known_octaves || -apart > self.tracks.options.known_octaves) return false;
      return are_beside(self.tracks, keyframe, v.keypoint, keypoint) && found(point);
    }
  };
  struct is_point {
    std::int32_t point;
    bool found;
    TURBOMAP_HD bool operator()(std::int32_t p) { return found = found || p == point; }
  };
  /// In how many views is this point seen?
  struct asked_in_others {
    const known_landmark& self;
    int view, end, wanted;
    bool found;
    TURBOMAP_HD bool operator()(std::int32_t point) {
      int seen = 1;
      for (int i = view + 1; i < end && seen < wanted; ++i) {
        is_point same{point, false};
        self.visit_beside(i, same);
        seen += same.found ? 1 : 0;
      }
      return found = seen >= wanted;
    }
  };
  template <class Found>
  TURBOMAP_HD void visit_beside(int i, Found& found) const {
    using std::sqrt;
    const track_view& v = tracks.views[i];
    const auto& keyframe = tracks.search.keyframes[v.keyframe];
    // The widest that a keypoint of an octave that is near enough may be away.
    const int octave = keyframe.octave[v.keypoint], last = tracks.options.scales.levels - 1;
    const int coarse = last - octave < tracks.options.known_octaves ? last : octave + tracks.options.known_octaves;
    const decision own(tracks.search.sigma2[octave]), coarsest(tracks.search.sigma2[coarse]);
    const decision radius = sqrt(decision(tracks.options.known_chi2) * (own + coarsest));
    beside<Found> visit{*this, i, found};
    const vec2<float> pixel = keyframe.pixel[v.keypoint];
    visit_window(keyframe, v.camera, static_cast<double>(pixel.x), static_cast<double>(pixel.y), radius.value,
                 radius.value, visit);
  }
};

TURBOMAP_END_NAMESPACE
