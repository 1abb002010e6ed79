// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How many keyframes see a point at each octave of the pyramid, from a flat list of its observations. A keyframe that sees it in
/// several cameras counts once, at the finest octave of them.

#include <cstddef>
#include <cstdint>

#include "../map/simple_map/observation_pool.hpp"
#include "../span.hpp"

namespace turbomap {

/// Adds them to `counts`. O(observations^2): lists are short.
/// \param octave_of  octave_of(observation): its octave; negative: it does not count
/// \param counts     [octave]
template <class OctaveOf>
void count_finest_octaves(span<const observation> list, const OctaveOf& octave_of, std::uint32_t* counts) {
  const std::size_t n = list.size();
  for (std::size_t v = 0; v < n; ++v) {
    bool first = true;
    for (std::size_t u = 0; u < v; ++u) first = first && list[u].keyframe != list[v].keyframe;
    if (!first) continue;
    int finest = -1;
    for (std::size_t u = v; u < n; ++u) {
      if (list[u].keyframe != list[v].keyframe) continue;
      const int octave = octave_of(list[u]);
      if (octave >= 0 && (finest < 0 || octave < finest)) finest = octave;
    }
    if (finest >= 0) ++counts[finest];
  }
}

}  // namespace turbomap
