// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Claims on a keypoint: several searches of one launch may find the same keypoint, and the most similar one gets it. The
/// winner is the least claim, whatever the order in which they are made.

#include <cstdint>
#include <cstring>

#include "config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// A descriptor distance as an integer of the same order. Distances are not negative, so the bits of a float are ordered
/// like its value, and those of an int anyway.
template <class Distance>
TURBOMAP_HD std::uint32_t ordered_bits(const Distance& distance) {
  static_assert(
      sizeof(Distance) == 4,
      "turbomap: one_to_one and tracks need a descriptor whose distance_type has 32 bits: float, std::int32_t...");
  std::uint32_t bits = 0;
  if (distance != 0) std::memcpy(&bits, &distance, sizeof(bits));  // -0.0F is 0
  return bits;
}

/// A claim, ordered by (distance, claimant): the distance in the upper half, who claims in the lower. Meant for
/// atomic_min().
template <class Distance>
TURBOMAP_HD std::uint64_t make_claim(const Distance& distance, std::uint32_t claimant) {
  return static_cast<std::uint64_t>(ordered_bits(distance)) << 32 | claimant;
}

TURBOMAP_END_NAMESPACE
