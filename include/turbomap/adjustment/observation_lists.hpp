// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What order_observations.hpp makes the lists of observations of, what it writes, and what it reports: its kernels are made of these.

#include <cstdint>

#include "../config.hpp"
#include "structure.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What the lists are made of, where the policy computes.
struct observation_input {
  int rows;                                    ///< observations
  int frames;                                  ///< all, fixed ones included
  int free_frames;                             ///< frames that move
  int landmarks;                               ///< all, fixed ones included
  int kinds;                                   ///< see landmark_group_input
  const std::int32_t* key_of_frame = nullptr;  ///< [frame] see structure_builder::keys()
  const std::int32_t* frame_of_key = nullptr;  ///< [frame] the inverse
  const std::int32_t* frame = nullptr;         ///< [row] frame that sees
  const std::int32_t* landmark = nullptr;      ///< [row] landmark that is seen
  const std::uint8_t* kind = nullptr;          ///< [row] below `kinds`
  const std::uint8_t* fixed = nullptr;         ///< [landmark] null: none

  /// Frames and kinds: the rows of each have chunks of their own.
  int bins() const { return frames * kinds; }
  /// Chunks that there may be.
  int most_chunks() const { return rows / observation_padding + (bins() < rows ? bins() : rows); }
};

/// Where they are written: there is room for most_chunks() chunks and as many slots as rows. See sum_lists, group_structure.
struct observation_lists {
  std::int32_t* landmark_row;    ///< [landmark + 1]
  std::int32_t* landmark_slot;   ///< [landmark + 1]
  std::int32_t* slot_coupling;   ///< [slot + 1]
  std::int32_t* slot_frame;      ///< [slot]
  std::int32_t* slot_landmark;   ///< [slot]
  std::int32_t* frame_partial;   ///< [free frame + 1]
  std::int32_t* partial_list;    ///< chunks of free frames
  std::int32_t* frame_slot;      ///< [free frame + 1]
  std::int32_t* slot_list;       ///< slots, frame by frame
  observation_chunk* chunks;     ///< [chunk]
  std::int32_t* source;          ///< [entry] row of the input
  std::int32_t* entry_landmark;  ///< [entry]
  std::int32_t* row;             ///< [entry] place in the order by landmark
  std::int32_t* coupling;        ///< [entry] -1: fixed frame
};

/// What the host is told.
struct observation_report {
  structure_sizes sizes;    ///< of the lists
  std::int32_t too_long;    ///< not 0: a landmark has too many rows for this way; the lists mean nothing
  std::int32_t not_finite;  ///< not 0: a number that was given is not finite (place_observations, place_estimate)
};

TURBOMAP_END_NAMESPACE
