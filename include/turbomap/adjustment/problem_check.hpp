// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Whether the frames and landmarks that a problem is given can be used: sizes that belong together, quaternions of unit length.
/// Numbers that are not finite are no error of the caller's; adjust() ends with adjustment_end::not_finite then. What is asked of
/// groups of factors stands with each kind (resident_group.hpp).

#include "../config.hpp"
#include "../error.hpp"
#include "../math/functions.hpp"
#include "factors.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

template <class Frame>
bool all_finite(const frame_input<Frame>& frames) {
  bool finite = true;
  for (const auto& x : frames.states) {
    const auto& T = Frame::template pose<double>(x);
    finite = finite && each_finite(T.qx, T.qy, T.qz, T.qw) && each_finite(T.tx, T.ty, T.tz);
  }
  return finite;
}
inline bool all_finite(const landmark_input& landmarks) {
  bool finite = true;
  for (const auto& p : landmarks.positions) finite = finite && each_finite(p.x, p.y, p.z);
  return finite;
}

/// Throws std::invalid_argument.
template <class Frame>
void check_sizes(const frame_input<Frame>& frames, const landmark_input& landmarks) {
  require(frames.fixed.empty() || frames.fixed.size() == frames.states.size(), "frames.fixed.size()",
          frames.fixed.size(), "must be that of states, or 0");
  require(landmarks.fixed.empty() || landmarks.fixed.size() == landmarks.positions.size(), "landmarks.fixed.size()",
          landmarks.fixed.size(), "must be that of positions, or 0");
  require(frames.held.empty() || frames.held.size() == frames.states.size(), "frames.held.size()", frames.held.size(),
          "must be that of states, or 0");
  require(Frame::dof <= 32 || frames.held.empty(), "frames.held.size()", frames.held.size(),
          "must be 0: masks are for frames of up to 32 unknowns");
}
/// Throws std::invalid_argument. Quaternions in float, many times composed, are off by some 1e-6: factors of the user's own see
/// them as they are.
template <class Frame>
void check_rotations(const frame_input<Frame>& frames) {
  constexpr double unit_tolerance = 1e-3;
  for (const auto& x : frames.states) {
    const auto& T = Frame::template pose<double>(x);
    const double square = T.qx * T.qx + T.qy * T.qy + T.qz * T.qz + T.qw * T.qw;
    const bool given = each_finite(T.qx, T.qy, T.qz, T.qw);
    require(!given || (square > 1 - unit_tolerance && square < 1 + unit_tolerance),
            "frames.states: squared norm of a quaternion", square, "must be 1");
  }
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
