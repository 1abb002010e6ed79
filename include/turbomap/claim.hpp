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

/// A claim, ordered by (distance, claimant): the distance in the upper half, who claims in the lower. Distances are not
/// negative, so the bits of a float are ordered like its value, and those of an int anyway. Meant for atomic_min().
template <class Distance>
TURBOMAP_HD std::uint64_t make_claim(const Distance& distance, std::uint32_t claimant) {
  static_assert(sizeof(Distance) == 4,
                "turbomap: one_to_one needs a descriptor whose distance_type has 32 bits: float, std::int32_t...");
  std::uint32_t bits = 0;
  if (distance != 0) std::memcpy(&bits, &distance, sizeof(bits));  // -0.0F is 0
  return static_cast<std::uint64_t>(bits) << 32 | claimant;
}

TURBOMAP_END_NAMESPACE
