// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How far landmarks typically are from the frames that see them. Wide-angle cameras of a problem are prepared for this distance
/// (resident_reprojections.hpp).

#include <algorithm>
#include <cstddef>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/rotation.hpp"
#include "../span.hpp"
#include "factors.hpp"
#include "structure_input.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The median over rows that are spread evenly, in the unit of the landmarks. 0: there are none.
template <class Frame>
TURBOMAP_ONE_BODY double median_distance(span<const landmark_group_input> groups, const frame_input<Frame>& frames,
                                         const landmark_input& landmarks) {
  constexpr std::size_t most = 256;  // the median of so many is within 10 % of the ranks of the true one
  double distances[most];
  std::size_t rows = 0, at = 0, count = 0;
  for (const auto& g : groups) rows += g.frame.size();
  const std::size_t step = rows / most + 1;
  for (const auto& g : groups) {
    for (; at < g.frame.size(); at += step) {
      const auto& T = Frame::template pose<double>(frames.states[static_cast<std::size_t>(g.frame[at])]);
      const vec3<double> p = to_isometry<double>(T) * landmarks.positions[static_cast<std::size_t>(g.landmark[at])];
      const double distance = norm(p);
      if (!detail::is_finite(distance)) continue;
      distances[count++] = distance;
    }
    at -= g.frame.size();
  }
  if (count == 0) return 0;
  std::nth_element(distances, distances + count / 2, distances + count);
  return distances[count / 2];
}

TURBOMAP_END_NAMESPACE
