// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Culling of keyframes and of recent points as defined, on the map oracle: every count from nothing, every time.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "map_oracle.hpp"

namespace turbomap_test {

struct oracle_culling_rules {
  float share = 0.9F;
  int observers = 3, slack = 1;
  float max_depth = 0;
  int fewest = 2;
  bool guards = false;
  int keep_keyframes = 21, keep_last = 2;
  double max_gap = 0.5, max_old_gap = 3;
  bool initialised = true;
  bool first_stays = true;  ///< the keyframe with id 0
};

struct oracle_culled {
  oracle_id keyframe;
  int points = 0, redundant = 0;
  bool erased = false, looked_at = true;
};

/// How many other keyframes see the point at `octave` or finer.
inline int other_observers(const map_oracle& map, oracle_id point, oracle_id keyframe, int octave) {
  int others = 0;
  for (const auto& [observer, finest] : map.finest(point)) others += observer != keyframe && finest <= octave ? 1 : 0;
  return others;
}

/// Whether the guards of inertial systems keep the keyframe. Ids ascend in time, and all keyframes are of one chain.
inline bool guarded(const map_oracle& map, oracle_id keyframe, oracle_id current, const oracle_culling_rules& rules) {
  std::vector<oracle_id> chain;
  for (const auto& [id, unused] : map.keyframes) chain.push_back(id);
  const auto place = [&chain](oracle_id id) { return std::find(chain.begin(), chain.end(), id) - chain.begin(); };
  const auto here = place(keyframe), now = place(current);
  if (now + 1 <= rules.keep_keyframes || here + rules.keep_last >= now) return true;
  if (here == 0 || here + 1 == static_cast<std::ptrdiff_t>(chain.size())) return true;
  const double gap = map.keyframes.at(chain[static_cast<std::size_t>(here) + 1]).time_s -
                     map.keyframes.at(chain[static_cast<std::size_t>(here) - 1]).time_s;
  const bool old = rules.initialised && here + rules.keep_keyframes < now;
  return !(gap < rules.max_gap || (old && gap < rules.max_old_gap));
}

/// Looks at the candidates one after the other; `survivors` gets the points that lost a view and live on.
inline std::vector<oracle_culled> cull_keyframes_by_definition(map_oracle& map, oracle_id current,
                                                               const std::vector<oracle_id>& candidates,
                                                               const oracle_culling_rules& rules,
                                                               std::multiset<oracle_id>& survivors) {
  std::vector<oracle_culled> all;
  for (const oracle_id keyframe : candidates) {
    oracle_culled one{keyframe};
    if (map.keyframes.count(keyframe) == 0 || keyframe == current || (rules.first_stays && keyframe == 0)) {
      one.looked_at = false;
      all.push_back(one);
      continue;
    }
    const auto& keypoints = map.keyframes.at(keyframe).keypoints;
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const auto point = map.point_at({keyframe, i});
      if (!point) continue;
      if (rules.max_depth > 0 && !(keypoints[i].depth >= 0 && keypoints[i].depth <= rules.max_depth)) continue;
      ++one.points;
      if (other_observers(map, *point, keyframe, keypoints[i].octave + rules.slack) > rules.observers) ++one.redundant;
    }
    one.erased = static_cast<float>(one.redundant) > rules.share * static_cast<float>(one.points) &&
                 !(rules.guards && guarded(map, keyframe, current, rules));
    if (one.erased) {
      for (const oracle_id point : map.erase_keyframe(keyframe, rules.fewest)) survivors.insert(point);
    }
    all.push_back(one);
  }
  return all;
}

struct oracle_recent {
  oracle_id point;
  std::int64_t since;
};

/// One round of point culling; `ratio` is found / visible of points where it is known. Returns the points that die.
inline std::set<oracle_id> cull_points_by_definition(map_oracle& map, std::vector<oracle_recent>& recent,
                                                     std::int64_t now, const std::map<oracle_id, float>& ratio,
                                                     float min_ratio, int fewest, int patience, int probation) {
  std::set<oracle_id> failed;
  std::vector<oracle_recent> left;
  for (const oracle_recent& r : recent) {
    if (map.points.count(r.point) == 0) continue;
    const auto known = ratio.find(r.point);
    const bool lost = known != ratio.end() && known->second < min_ratio;
    if (lost || (now - r.since >= patience && map.measurements(r.point) <= fewest))
      failed.insert(r.point);
    else if (now - r.since < probation)
      left.push_back(r);
  }
  for (const oracle_id point : failed) map.erase_point(point);
  recent.clear();
  for (const oracle_recent& r : left)
    if (map.points.count(r.point) != 0) recent.push_back(r);
  return failed;
}

}  // namespace turbomap_test
