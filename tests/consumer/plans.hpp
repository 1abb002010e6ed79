// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What the user's mapper gives: plans of the library, which are plain data, the same in .cpp and .cu files.

#include <turbomap/matching/creation_plan.hpp>
#include <turbomap/matching/search_options.hpp>

#include <cmath>
#include <cstdint>
#include <vector>

#include "frame.hpp"

namespace my {

struct plans {
  std::vector<turbomap::correspondence<std::int32_t>> matches;
  std::vector<turbomap::created_point> points;
};

/// Every field of every entry, positions to the last bit.
inline bool equal(const plans& a, const plans& b) {
  if (a.matches.size() != b.matches.size() || a.points.size() != b.points.size()) return false;
  for (std::size_t i = 0; i < a.matches.size(); ++i) {
    const auto &m = a.matches[i], &n = b.matches[i];
    if (m.neighbour != n.neighbour || m.query != n.query || m.candidate != n.candidate || m.distance != n.distance)
      return false;
  }
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const auto &p = a.points[i], &q = b.points[i];
    if (p.neighbour != q.neighbour || p.query != q.query || p.candidate != q.candidate || p.outcome != q.outcome ||
        p.method != q.method || p.position.x != q.position.x || p.position.y != q.position.y ||
        p.position.z != q.position.z)
      return false;
  }
  return true;
}

/// Are nearly all features of the last frame matched with their like, and their points where the scene has them?
inline bool plausible(const plans& p) {
  std::size_t right = 0, near = 0;
  for (const auto& m : p.matches) right += m.query == m.candidate ? 1 : 0;
  for (const auto& c : p.points) {
    const auto [x, y, z] = scene_point(c.query);
    if (c.outcome != turbomap::creation_outcome::accepted) continue;
    near += std::hypot(c.position.x - x, c.position.y - y, c.position.z - z) < 0.01 ? 1 : 0;
  }
  return right > 700 && near > 700;
}

}  // namespace my
