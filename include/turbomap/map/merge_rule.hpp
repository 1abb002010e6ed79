// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What becomes of a merge of two points that one camera sees apart, as plain data.

#include <cstdint>

#include "../types.hpp"

namespace turbomap {

/// What becomes of a merge of two points that one camera of a keyframe sees at two different keypoints.
enum class merge_rule : std::uint8_t {
  refuse,  ///< they are two points: nothing is changed, nothing is lost
  drop,    ///< the keypoint of the point that goes is left without a point, as the recorded peer does
  refuse_apart  ///< refuse, if a pair of such keypoints is farther apart than their noise; else drop: detectors find one corner
                ///< in several octaves. Refuse also what is known to lie apart: merge_tolerance::position_chi2
};

/// When two keypoints of an image may be one: squared distance <= chi2 (sigma2 of one + sigma2 of the other),
/// sigma2 = scale_factor^(2 octave) px^2.
struct merge_tolerance {
  double chi2 = 5.991;  ///< 95 %, 2 dof
  /// Of points whose covariances the map keeps: largest squared distance, by the sum of both. 99.9 %, 3 dof. 0: any. For
  /// positions that fit all their views best: without adjustment they do not, and true duplicates are refused.
  double position_chi2 = 16.27;
  /// Of the pyramid.
  float scale_factor = pyramid{}.scale_factor;
};

}  // namespace turbomap
