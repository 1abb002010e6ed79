// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The cameras of a recording as the oracles of adjustments take them.

#include <cstddef>
#include <vector>

#include <turbomap/io/recording.hpp>
#include <turbomap/math/linear.hpp>

#include "reprojection_cost.hpp"

namespace turbomap_test {

inline std::vector<cost_camera> recorded_cost_rig(const turbomap::recording_meta& m) {
  const auto camera = [&](const std::vector<double>& p) {
    cost_camera c;
    c.fx = p[0], c.fy = p[1], c.cx = p[2], c.cy = p[3];
    c.fisheye = m.is_fisheye();
    for (std::size_t i = 4; i < p.size(); ++i) c.k[i - 4] = p[i];
    return c;
  };
  std::vector<cost_camera> rig{camera(m.camera1)};
  if (m.camera2.empty()) {
    rig[0].bf = m.bf;
    return rig;
  }
  rig.push_back(camera(m.camera2));
  const auto T = turbomap::cast<double>(m.T_rl);
  rotation_matrix(T, rig[1].R);
  rig[1].t[0] = T.tx, rig[1].t[1] = T.ty, rig[1].t[2] = T.tz;
  return rig;
}

}  // namespace turbomap_test
