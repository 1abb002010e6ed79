// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A commit of duplicates, entry by entry, as the rules read, on the map oracle.

#include <vector>

#include "map_oracle.hpp"

namespace turbomap_test {

/// A point was found at a keypoint.
struct oracle_entry {
  oracle_id point;
  oracle_view view;
};

/// The numbers of turbomap::fusion_action.
enum oracle_action {
  oracle_added = 1,
  oracle_candidate_gone = 2,
  oracle_holder_gone = 3,
  oracle_stale = 5,
  oracle_seen = 6,
  oracle_apart = 7
};

struct oracle_commit {
  std::vector<int> actions;
  std::vector<oracle_id> gained;     ///< points that gained observations, in order
  std::vector<oracle_id> survivors;  ///< of merges, in order
};

inline oracle_commit commit_duplicates(map_oracle& map, const std::vector<oracle_entry>& plan,
                                       const oracle_merge_rule& rule) {
  oracle_commit result;
  for (const oracle_entry& entry : plan) {
    const auto one = [&]() -> int {
      const auto candidate = map.resolve(entry.point);
      if (!candidate || map.keyframes.count(entry.view.first) == 0) return oracle_stale;
      if (map.camera_sees(*candidate, entry.view.first, map.keypoint(entry.view).camera)) return oracle_seen;
      const auto other = map.point_at(entry.view);
      if (!other) {
        map.observe(*candidate, entry.view);
        result.gained.push_back(*candidate);
        return oracle_added;
      }
      const bool candidate_goes = map.measurements(*other) > map.measurements(*candidate);
      const oracle_id from = candidate_goes ? *candidate : *other, into = candidate_goes ? *other : *candidate;
      if (!map.merge(from, into, rule)) return oracle_apart;
      result.gained.push_back(into), result.survivors.push_back(into);
      return candidate_goes ? oracle_candidate_gone : oracle_holder_gone;
    };
    result.actions.push_back(one());
  }
  return result;
}

}  // namespace turbomap_test
