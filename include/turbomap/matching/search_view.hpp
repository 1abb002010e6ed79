// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A correspondence search in the memory of its policy: everything the kernels, filters and point creation read, as plain
/// pointers, and the state of one query keypoint while its candidates are scanned.

#include <cstdint>

#include "../config.hpp"
#include "epipolar.hpp"
#include "search_options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// No candidate passed.
inline constexpr std::int32_t no_match = -1;

/// Views of one search. Keyframe 0 is the query, keyframe 1 + n is neighbour n. `slot` numbers the query keypoints that hold
/// no map point; results are [neighbour][slot].
template <class Descriptor, class Camera>
struct search_view {
  using distance_type = typename Descriptor::distance_type;

  const keyframe_view<Descriptor, Camera>* keyframes;  ///< 1 + neighbour_count
  const rigid_transform<double>* T_cw;                 ///< 1 + neighbour_count
  const std::uint8_t* has_point;                       ///< of all neighbours, one after the other
  const std::int32_t* has_point_offset;                ///< neighbour_count
  const std::int32_t* candidates;                      ///< keypoints without a map point of all neighbours, ascending
  const std::int32_t* candidate_offset;                ///< neighbour_count + 1
  const std::int32_t* queries;                         ///< slot_count keypoints of the query, ascending
  const float* scale;                                  ///< scale_factor^o
  const float* sigma2;                                 ///< scale_factor^(2 o)
  pair_geometry* pairs;                                ///< [neighbour][query camera][neighbour camera]
  std::int32_t* match;                                 ///< [neighbour][slot]: candidate keypoint or no_match
  distance_type* distance;                             ///< [neighbour][slot]: its descriptor distance
  int neighbour_count;
  int slot_count;
  int query_cameras;
  int neighbour_cameras;  ///< the most of any neighbour
  distance_type max_distance;
  search_options options;

  TURBOMAP_HD const keyframe_view<Descriptor, Camera>& query() const { return keyframes[0]; }
  TURBOMAP_HD const keyframe_view<Descriptor, Camera>& neighbour(int n) const { return keyframes[1 + n]; }
  TURBOMAP_HD pair_geometry& pair(int n, int query_camera, int neighbour_camera) const {
    return pairs[(n * query_cameras + query_camera) * neighbour_cameras + neighbour_camera];
  }
};

/// Computes pair `i` of the search.
template <class Descriptor, class Camera>
struct prepare_pair {
  search_view<Descriptor, Camera> search;

  TURBOMAP_HD void operator()(int i) const {
    const int b = i % search.neighbour_cameras, a = i / search.neighbour_cameras % search.query_cameras;
    const int n = i / (search.neighbour_cameras * search.query_cameras);
    const auto& query = search.query();
    const auto& neighbour = search.neighbour(n);
    if (b >= neighbour.camera_count) return;  // a rig with fewer cameras than another neighbour's
    // An epipole guard makes sense where depth comes from motion only: on a rig the other camera sees the point too.
    const bool guard = query.camera_count == 1 && neighbour.camera_count == 1;
    search.pair(n, a, b) =
        make_pair_geometry(query.cameras[a], search.T_cw[0], neighbour.cameras[b], search.T_cw[1 + n], guard);
  }
};

/// One query keypoint against one neighbour, candidate by candidate, in any order: the result depends on the set of
/// candidates only. The geometry of a candidate is looked at only if its distance can still win.
template <class Descriptor, class Camera>
class candidate_scan {
 public:
  using distance_type = typename Descriptor::distance_type;

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

  TURBOMAP_HD distance_type best_distance() const { return best_distance_; }
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
    const int b = neighbour_.camera_of(candidate);
    const pair_geometry& g = search_.pair(n_, query_.camera_of(keypoint_), b);
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
