// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The map that a recorded keyframe culling saw, made consistent.

#include <cstddef>
#include <cstdint>
#include <vector>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include "readers/recording_snapshot.hpp"
#include "recorded_keyframes.hpp"

namespace turbomap_replay {

/// The recorded observations as a map that keeps its promises: what finds its slot or camera taken is left out.
template <class Camera>
struct repaired_map {
  using map = turbomap::simple_map<orb, Camera>;
  using traits = turbomap::map_traits<map>;

  repaired_map(const turbomap::recording& r, const turbomap::recording_snapshot& s) {
    const auto& c = *s.culling;
    for (std::size_t k = 0; k <= static_cast<std::size_t>(s.keyframe); ++k) {
      const auto keypoints = r.gather_keypoints(k);
      keyframes.push_back(state.add_keyframe(keypoints, turbomap::cast<double>(r.T_cw[k]),
                                             1e-9 * static_cast<double>(r.t_ns[k] - r.t_ns[0]),
                                             k == 0 ? turbomap::map_keyframe_id{} : keyframes.back()));
    }
    for (std::size_t p = 0; p < c.point.size(); ++p) {
      points.push_back(state.add_point({0, 0, 1}));
      for (std::size_t o = c.observations(p).begin; o < c.observations(p).end; ++o)
        for (const std::int32_t view : c.obs_keypoints[o])
          if (view >= 0 && turbomap::observe(state, points[p], keyframes[static_cast<std::size_t>(c.obs_kf[o])],
                                             static_cast<std::size_t>(view)))
            ++views;
    }
  }

  map state;
  std::vector<turbomap::map_keyframe_id> keyframes;
  std::vector<turbomap::map_point_id> points;
  std::size_t views = 0;
};

}  // namespace turbomap_replay
