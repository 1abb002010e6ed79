// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The search of one query keypoint in one neighbour: the best candidate so far, and the tests that a better one has to pass.

#include <cstdint>

#include "../config.hpp"
#include "epipolar.hpp"
#include "search_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One query keypoint against one neighbour, candidate by candidate, in any order: the result depends on the set of
/// candidates only. The geometry of a candidate is looked at only if its distance can still win.
template <class Descriptor, class Camera>
class candidate_scan {
 public:
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  /// No candidate yet. \param search  must outlive this
  TURBOMAP_HD candidate_scan(const search_view<Descriptor, Camera>& search, int neighbour, int query_keypoint)
      : search_(search),
        query_(search.query()),
        neighbour_(search.neighbour(neighbour)),
        n_(neighbour),
        keypoint_(query_keypoint),
        best_distance_(search.max_distance) {}
  /// Goes on from an earlier result over other candidates.
  TURBOMAP_HD candidate_scan(const search_view<Descriptor, Camera>& search, int neighbour, int query_keypoint,
                             std::int32_t best, distance_type best_distance)
      : candidate_scan(search, neighbour, query_keypoint) {
    best_ = best;
    best_distance_ = best_distance;
  }

  /// Distance of the best candidate; the largest allowed where there is none.
  TURBOMAP_HD distance_type best_distance() const { return best_distance_; }
  /// The best candidate, a keypoint of the neighbour; no_match: none.
  TURBOMAP_HD std::int32_t best() const { return best_; }

  /// Takes the candidate if its distance `d` wins and the pair is consistent.
  TURBOMAP_HD void consider(std::int32_t candidate, distance_type d) {
    if (!(d <= best_distance_)) return;
    if (d == best_distance_ && best_ != no_match &&
        (search_.options.ties == tie_rule::lowest_index ? candidate > best_ : candidate < best_))
      return;
    if (!consistent(candidate)) return;
    best_distance_ = d;
    best_ = candidate;
  }

  /// The geometric test alone.
  TURBOMAP_HD bool consistent(std::int32_t candidate) {
    const int a = query_.camera_of(keypoint_), b = neighbour_.camera_of(candidate);
    if (!search_.compares(n_, a, b)) return false;
    const pair_geometry& g = search_.pair(n_, a, b);
    if (b != prepared_camera_) {
      epipolar_ = make_query_epipolar(g, query_, keypoint_);
      prepared_camera_ = b;
    }
    return epipolar_consistent(g, epipolar_, query_, keypoint_, neighbour_, candidate, search_.sigma2, search_.scale,
                               search_.options);
  }

 private:
  const search_view<Descriptor, Camera>& search_;
  const keyframe_view<Descriptor, Camera>& query_;
  const keyframe_view<Descriptor, Camera>& neighbour_;
  query_epipolar epipolar_;
  int n_;
  int keypoint_;
  int prepared_camera_ = -1;
  distance_type best_distance_;
  std::int32_t best_ = no_match;
};

TURBOMAP_END_NAMESPACE
