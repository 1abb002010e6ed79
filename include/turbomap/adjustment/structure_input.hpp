// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the structure of a problem is made of: the indices of frames and landmarks in all groups of factors, as the caller gave them.

#include <cstdint>

#include "../span.hpp"

namespace turbomap {

/// What the structure needs to know of a group of factors with landmarks.
struct landmark_group_input {
  span<const std::int32_t> frame;     ///< [row] frame
  span<const std::int32_t> landmark;  ///< [row] landmark
  const std::uint8_t* kind;           ///< one per row, below `kinds`; null: all 0
  int kinds;                          ///< kinds of rows
};

/// What it needs to know of a group of factors of frames.
struct frame_group_input {
  span<const std::int32_t> first;   ///< [row] frame, or the first of two
  span<const std::int32_t> second;  ///< empty: factors of one frame
};

/// Indices of a problem, as places in the inputs of the caller.
struct structure_input {
  int frames;                                        ///< of the problem
  int landmarks;                                     ///< of the problem
  span<const std::uint8_t> fixed_frames;             ///< empty: none
  span<const landmark_group_input> landmark_groups;  ///< in the order of the caller's groups
  span<const frame_group_input> frame_groups;        ///< in the order of the caller's groups
  int chunk;                                  ///< entries that a chunk holds at most, a multiple of observation_padding
  span<const std::int32_t> landmark_place{};  ///< [landmark] its number in the structure; empty: as it is
};

}  // namespace turbomap
