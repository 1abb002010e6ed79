// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which keyframes and points a local adjustment takes, and which points its outliers leave, by definition: sets of ids, all
/// pairs compared. It uses none of the library.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace turbomap_test {

using oracle_ids = std::set<std::uint64_t>;

/// Who sees what: keyframe -> point -> the keypoints by which it does.
using oracle_sightings = std::map<std::uint64_t, std::map<std::uint64_t, std::vector<std::size_t>>>;

struct oracle_window {
  oracle_ids free, fixed, points;
  std::size_t observations = 0;
};

/// Keyframes that share enough points with one, most shared first, of equal ones the oldest (without any: the one that shares most).
inline std::vector<std::uint64_t> covisible_by_definition(const oracle_sightings& seen, std::uint64_t keyframe,
                                                          int min_shared) {
  std::vector<std::pair<int, std::uint64_t>> found;
  std::pair<int, std::uint64_t> best{0, 0};
  for (const auto& [k, points] : seen) {
    int shared = 0;
    for (const auto& [p, unused] : seen.at(keyframe)) shared += points.count(p) != 0 ? 1 : 0;
    if (k == keyframe || shared == 0) continue;
    if (shared >= min_shared) found.push_back({shared, k});
    if (shared > best.first) best = {shared, k};
  }
  if (found.empty() && best.first > 0) found.push_back(best);
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a.second < b.second; });
  std::vector<std::uint64_t> ids;
  for (const auto& [unused, k] : found) ids.push_back(k);
  return ids;
}

/// Free: the current keyframe, those that are covisible with it and, if second_min_shared is not 0, those that are covisible with
/// one of these, but not the origin; no more than `most` in this order, with the origin. Fixed: all others that see a point of
/// theirs, and the origin among them. With none fixed: the oldest.
inline oracle_window window_by_definition(const oracle_sightings& seen, std::uint64_t current, int min_shared,
                                          std::optional<std::uint64_t> origin, int second_min_shared = 0,
                                          std::size_t most = 1000000) {
  oracle_ids local{current}, first;
  for (const auto k : covisible_by_definition(seen, current, min_shared))
    if (local.size() < most) local.insert(k), first.insert(k);
  if (second_min_shared > 0)
    for (const auto k : covisible_by_definition(seen, current, min_shared))
      if (first.count(k) != 0)
        for (const auto other : covisible_by_definition(seen, k, second_min_shared))
          if (local.size() < most) local.insert(other);
  oracle_window w;
  for (const auto k : local)
    for (const auto& [p, unused] : seen.at(k)) w.points.insert(p);
  for (const auto& [k, points] : seen)
    for (const auto& [p, keypoints] : points) {
      if (w.points.count(p) == 0) continue;
      w.observations += keypoints.size();
      if (local.count(k) == 0) w.fixed.insert(k);
    }
  if (origin && local.count(*origin) != 0) w.fixed.insert(*origin);
  if (w.fixed.empty()) w.fixed.insert(*local.begin());
  for (const auto k : local)
    if (w.fixed.count(k) == 0) w.free.insert(k);
  return w;
}

/// Free: all keyframes that are connected with `anyone` through shared points, but not the origin; with none fixed the
/// oldest is.
inline oracle_window connected_by_definition(const oracle_sightings& seen, std::uint64_t anyone,
                                             std::optional<std::uint64_t> origin) {
  oracle_window w;
  oracle_ids all{anyone};
  for (std::size_t before = 0; before != all.size();) {
    before = all.size();
    for (const auto k : all)
      for (const auto& [p, unused] : seen.at(k)) w.points.insert(p);
    for (const auto& [k, points] : seen)
      for (const auto& [p, unused] : points)
        if (w.points.count(p) != 0) all.insert(k);
  }
  for (const auto k : all)
    for (const auto& [p, keypoints] : seen.at(k)) w.observations += keypoints.size();
  if (origin && all.count(*origin) != 0) w.fixed.insert(*origin);
  if (w.fixed.empty()) w.fixed.insert(*all.begin());
  for (const auto k : all)
    if (w.fixed.count(k) == 0) w.free.insert(k);
  return w;
}

/// An observation that may be an outlier. Stereo ones are two measurements.
struct oracle_observation {
  std::uint64_t keyframe, point;
  std::size_t keypoint;
  int measurements;
  bool outlier;
};

/// Points that have `fewest` measurements or less without their outliers. One that has none of these lives.
inline oracle_ids dead_by_definition(const std::vector<oracle_observation>& all, int fewest) {
  std::map<std::uint64_t, int> left;
  oracle_ids lost, dead;
  for (const auto& o : all) {
    left[o.point] += o.outlier ? 0 : o.measurements;
    if (o.outlier) lost.insert(o.point);
  }
  for (const auto p : lost)
    if (left[p] <= fewest) dead.insert(p);
  return dead;
}

}  // namespace turbomap_test
