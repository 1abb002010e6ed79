// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What differs between two maps of objects that should be the same.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include <turbomap/math/linear.hpp>

#include "../objects_map/objects_map.hpp"

namespace turbomap_before_after {

/// The larger of two differences. One that is no number counts as infinite: std::max would drop it.
inline double worst(double so_far, double difference) {
  return std::isnan(difference) ? HUGE_VAL : std::max(so_far, difference);
}

/// What differs between two maps.
struct map_difference {
  std::size_t keyframes = 0, points = 0, observations = 0, descriptors = 0;
  double position_m = 0, appearance = 0;  ///< largest: m; relative, of normals and ranges
  bool equal() const {
    return keyframes + points + observations + descriptors == 0 && position_m <= 1e-6 && appearance <= 1e-5;
  }
};

/// Points are compared by their ids.
template <class Camera>
map_difference compare(const turbomap_program::objects_map<Camera>& a, const turbomap_program::objects_map<Camera>& b) {
  using turbomap_program::keyframe_ptr;
  using turbomap_program::point_ptr;
  using map_type = turbomap_program::objects_map<Camera>;
  using traits = turbomap::map_traits<map_type>;
  map_difference d;
  std::vector<std::uint64_t> keyframes[2];
  std::map<std::uint64_t, point_ptr> points[2];
  const map_type* maps[]{&a, &b};
  for (int m = 0; m < 2; ++m) {
    traits::for_each_keyframe(*maps[m], [&](const keyframe_ptr& k) { keyframes[m].push_back(k->id); });
    traits::for_each_point(*maps[m], [&](const point_ptr& p) { points[m][p->id] = p; });
  }
  d.keyframes = keyframes[0] == keyframes[1] ? 0 : 1;
  const auto views = [](const map_type& map, const point_ptr& p) {
    std::vector<std::pair<std::uint64_t, std::size_t>> list;
    for (const auto& v : map.observations(p)) list.push_back({v.keyframe->id, v.keypoint});
    std::sort(list.begin(), list.end());
    return list;
  };
  for (const auto& [id, p] : points[0]) {
    const auto other = points[1].find(id);
    if (other == points[1].end()) {
      ++d.points;
      continue;
    }
    const point_ptr& q = other->second;
    d.observations += views(a, p) == views(b, q) ? 0 : 1;
    d.descriptors += std::equal(p->descriptor(), p->descriptor() + 32, q->descriptor()) ? 0 : 1;
    d.position_m = worst(d.position_m, turbomap::norm(p->position() - q->position()));
    const auto x = p->appearance(), y = q->appearance();
    const auto off = [&](float u, float v, float size) {
      if (u != v) d.appearance = worst(d.appearance, static_cast<double>(std::abs(u - v) / size));  // 0 of 0 is none
    };
    off(x.normal.x, y.normal.x, 1), off(x.normal.y, y.normal.y, 1), off(x.normal.z, y.normal.z, 1);
    off(x.max_distance, y.max_distance, x.max_distance), off(x.min_distance, y.min_distance, x.min_distance);
  }
  for (const auto& [id, p] : points[1]) d.points += points[0].count(id) == 0 ? 1 : 0;
  return d;
}

}  // namespace turbomap_before_after
