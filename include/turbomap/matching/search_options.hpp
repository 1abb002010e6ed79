// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What a correspondence search takes and gives, as plain data: options and the plan.

#include <cstdint>

#include "../stop_request.hpp"
#include "../types.hpp"

namespace turbomap {

/// Which keypoints of a neighbour a query keypoint is compared with.
enum class candidates : std::uint8_t {
  /// All of them, one by one.
  exhaustive,
  /// All that can lie on its epipolar curve: the answer of `exhaustive`, found with a few percent of the comparisons. A device
  /// compares all, which it does faster than sorting them; the result is the same.
  epipolar_ordered,
  /// Those of its visual word group only [ORB-SLAM3 parity].
  grouped
};

/// Which candidate wins among equal descriptor distances.
enum class tie_rule : std::uint8_t {
  lowest_index,
  highest_index  ///< what the recorded peer does
};

/// Options of search_correspondences(). Defaults are those of [ORB-SLAM3] and [TurboMap §IV-C].
struct search_options {
  candidates candidate_set = candidates::epipolar_ordered;  ///< which keypoints are compared.
  tie_rule ties = tie_rule::lowest_index;                   ///< which of equal ones wins.
  pyramid scales;                                           ///< sigma2(o) = scale_factor^(2 o) px^2
  double max_distance = 50;          ///< largest descriptor distance of a match (50 of 256 bits: TH_LOW)
  double epipole_radius = 10;        ///< px at octave 0, grows with sqrt(s^o): candidates nearer to the epipole give no
                                     ///< depth. Single-camera rigs, both keypoints without u_right
  double line_chi2 = 3.84;           ///< gate of (distance to the epipolar line)^2 / sigma2: 95 %, 1 dof
  double reprojection_chi2 = 5.991;  ///< gate of reprojection error^2 / sigma2 (curved images): 95 %, 2 dof
  double max_parallax_cosine = 0.9998;  ///< curved images: rays closer to parallel are no match
  /// The cameras of the query's rig are matched with each other too: the query is one more neighbour, the last. For
  /// join_tracks(), which then has one track of what two cameras of the rig see.
  bool across_rig = false;
  /// On a device, bits are compared by its tensor cores where it has them (compute capability 8.0 on) and descriptors are whole
  /// words of 32 bits; else, and where this is false, by counting instructions. The answer is the same.
  bool tensor_cores = true;
  /// Once it says true, the search ends and has no matches, whatever it says then. Asked once before the search;
  /// after that on the host only, before every 64 query keypoints (ordered) or 256 (exhaustive). Never in a grouped search,
  /// which is short. Must outlive the search.
  stop_request stop;

  /// Whether it is to stop now.
  bool stopped() const { return stop(); }
};

/// One match: keypoint `query` of the query keyframe and keypoint `candidate` of neighbour number `neighbour`.
template <class Distance>
struct correspondence {
  std::int32_t neighbour;  ///< number in the list of neighbours.
  std::int32_t query;      ///< keypoint of the query keyframe.
  std::int32_t candidate;  ///< keypoint of the neighbour.
  Distance distance;       ///< between the two descriptors.
};

}  // namespace turbomap
