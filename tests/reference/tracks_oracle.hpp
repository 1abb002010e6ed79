// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracks as their definition reads: sets of keypoints that grow match by match, in quadratic time.

#include <turbomap/matching/track_joiner.hpp>

#include <algorithm>
#include <cstdint>
#include <set>
#include <tuple>
#include <vector>

namespace turbomap_test {

struct oracle_tracks {
  std::vector<std::vector<std::tuple<int, int, int>>> tracks;  ///< keyframe, camera, keypoint
  std::vector<turbomap::match_outcome> outcomes;               ///< by match
};

/// \param camera_of      camera_of(keyframe, keypoint); keyframe 0 is the query
/// \param own_neighbour  the neighbour that is the query itself; -1: none
template <class Distance, class CameraOf>
oracle_tracks tracks_oracle(const std::vector<turbomap::correspondence<Distance>>& matches, CameraOf camera_of,
                            int own_neighbour) {
  using node = std::tuple<int, int, int>;
  oracle_tracks result;
  result.outcomes.resize(matches.size());
  std::vector<std::size_t> order(matches.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
    const auto &a = matches[i], &b = matches[j];
    return std::tie(a.distance, a.query, a.neighbour, a.candidate) <
           std::tie(b.distance, b.query, b.neighbour, b.candidate);
  });
  std::vector<std::set<node>> sets;
  const auto set_of = [&](const node& n) {
    for (std::size_t s = 0; s < sets.size(); ++s)
      if (sets[s].count(n) != 0) return s;
    sets.push_back({n});
    return sets.size() - 1;
  };
  for (const std::size_t i : order) {
    const auto& m = matches[i];
    const int keyframe = m.neighbour == own_neighbour ? 0 : 1 + m.neighbour;
    const std::size_t a = set_of({0, camera_of(0, m.query), m.query});
    const std::size_t b = set_of({keyframe, camera_of(keyframe, m.candidate), m.candidate});
    result.outcomes[i] = turbomap::match_outcome::joined;
    if (a == b) continue;
    bool twice = false;
    for (const node& x : sets[a])
      for (const node& y : sets[b])
        twice = twice || (std::get<0>(x) == std::get<0>(y) && std::get<1>(x) == std::get<1>(y));
    if (twice) {
      result.outcomes[i] = turbomap::match_outcome::contradicts;
      continue;
    }
    sets[a].insert(sets[b].begin(), sets[b].end());
    sets[b].clear();
  }
  for (const auto& s : sets)
    if (s.size() > 1) result.tracks.emplace_back(s.begin(), s.end());  // by keyframe, camera
  const auto first_query = [](const std::vector<node>& track) {
    int least = std::get<2>(track.front());
    for (const node& n : track)
      if (std::get<0>(n) == 0) least = std::min(least, std::get<2>(n));
    return least;
  };
  std::sort(result.tracks.begin(), result.tracks.end(),
            [&](const auto& a, const auto& b) { return first_query(a) < first_query(b); });
  return result;
}

/// Nothing but equal.
inline bool same_tracks(const oracle_tracks& expected, const turbomap::track_list& got) {
  if (!(got.outcomes == expected.outcomes) || expected.tracks.size() != got.size()) return false;
  for (std::size_t t = 0; t < got.size(); ++t) {
    const auto begin = static_cast<std::size_t>(got.offsets[t]), end = static_cast<std::size_t>(got.offsets[t + 1]);
    if (end - begin != expected.tracks[t].size()) return false;
    for (std::size_t i = begin; i < end; ++i)
      if (std::make_tuple(got.views[i].keyframe, got.views[i].camera, got.views[i].keypoint) !=
          expected.tracks[t][i - begin])
        return false;
  }
  return got.views.size() == static_cast<std::size_t>(got.offsets.back());
}

}  // namespace turbomap_test
