// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Descriptors of keypoints and points, some replaced: by the one of another keypoint, or by numbers that no network
/// gives.

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "hostile.hpp"

namespace turbomap_fuzz {

/// Row i becomes another row, or one of its numbers any other.
template <class Descriptor>
void spoil_descriptor(std::vector<typename Descriptor::element>& rows, std::size_t i, choices& c) {
  using element = typename Descriptor::element;
  constexpr auto length = static_cast<std::size_t>(Descriptor::elements);
  element* const mine = rows.data() + i * length;
  if (c.flag()) {
    const std::size_t other = c.below(rows.size() / length);
    if (other != i) std::copy_n(rows.data() + other * length, length, mine);
    return;
  }
  element& one = mine[c.below(length)];
  if constexpr (std::is_floating_point_v<element>)
    one = c.single(4);
  else
    one = static_cast<element>(c.byte());
}

/// The largest distance of a match: a usual one, or nearly all there are.
template <class Descriptor>
double draw_distance(choices& c) {
  if constexpr (std::is_floating_point_v<typename Descriptor::distance_type>)
    return c.flag() ? 1.5 : 1e38;
  else if constexpr (std::is_signed_v<typename Descriptor::element>)
    return c.flag() ? 2e4 : 2e9;
  else
    return c.flag() ? 50 : 255;
}

}  // namespace turbomap_fuzz
