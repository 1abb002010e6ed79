// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of the correspondence search: the recorded batch pairs by word groups, and what groups lose of all.

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/matching/correspondence_search.hpp>

#include "recorded_scene.hpp"
#include "true_matches.hpp"

#include "reference/same_plans.hpp"

namespace turbomap_replay {

/// Search options with which the recorded system's matches come out.
inline turbomap::search_options parity_options(const turbomap::recording& recording, turbomap::candidates set) {
  turbomap::search_options o;
  o.candidate_set = set;
  o.ties = turbomap::tie_rule::highest_index;
  o.scales = recording.meta.pyramid();
  return o;
}

template <class Camera, class Policy>
class search_check {
 public:
  using posed = turbomap::posed_keyframe<orb, Camera>;
  using matches = turbomap::correspondences<orb, Camera, Policy>;
  using plan = typename matches::plan_type;

  explicit search_check(recorded_scene<Camera, Policy>& scene) : scene_(scene), matches_(scene.ctx) {}

  void check(const snapshot_scene<Camera, Policy>& at) {
    const turbomap::recording_snapshot& s = at.snapshot();
    std::vector<posed> neighbours;
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
      if (s.search.skipped[i] != 0) continue;
      neighbours.push_back(at.at(s.search.neighbours[i], s.mask2(i)));
      rows.push_back(i);
    }
    if (neighbours.empty()) return;
    const posed query = at.at(s.keyframe, s.mask1(0));

    const plan grouped = search(query, neighbours, turbomap::candidates::grouped);
    std::set<std::array<std::int32_t, 3>> ours, theirs;
    for (const auto& m : grouped) ours.insert({m.neighbour, m.query, m.candidate});
    for (std::size_t n = 0; n < rows.size(); ++n)
      for (const auto& pair : s.batch_pairs(rows[n])) theirs.insert({static_cast<std::int32_t>(n), pair[0], pair[1]});
    expected_ += theirs.size();
    for (const auto& m : theirs)
      if (ours.count(m) == 0) ++missing_, report_difference("search: missing neighbour, keypoints", s, m);
    for (const auto& m : ours)
      if (theirs.count(m) == 0) ++extra_, report_difference("search: extra neighbour, keypoints", s, m);

    const plan exhaustive = search(query, neighbours, turbomap::candidates::exhaustive);
    const plan ordered = search(query, neighbours, turbomap::candidates::epipolar_ordered);
    exhaustive_pairs_ += exhaustive.size();
    ordered_equals_exhaustive_ = ordered_equals_exhaustive_ && turbomap_test::same(ordered, exhaustive);
    std::map<std::array<std::int32_t, 2>, std::int32_t> distance;
    for (const auto& m : exhaustive) distance[{m.neighbour, m.query}] = m.distance;
    for (const auto& m : grouped) {
      const auto found = distance.find({m.neighbour, m.query});
      lost_ += found == distance.end() || found->second > m.distance ? 1 : 0;
    }
    if (scene_.recording.has_ground_truth()) {
      const true_matches<Camera> truth(scene_.recording, scene_.rig, s);
      grouped_truth_ += truth.judge(grouped, rows);
      exhaustive_truth_ += truth.judge(exhaustive, rows);
    }
  }

  /// Adds the keys of the contract.
  void add_json(nlohmann::json& json) const {
    json["search"] = {{"pairs_expected", expected_}, {"missing", missing_}, {"extra", extra_}};
    json["exhaustive"] = {{"pairs", exhaustive_pairs_},
                          {"grouped_queries_lost", lost_},
                          {"ordered_equals_exhaustive", ordered_equals_exhaustive_}};
    if (scene_.recording.has_ground_truth())
      json["true_matches"] = {{"grouped", grouped_truth_.json()}, {"exhaustive", exhaustive_truth_.json()}};
  }
  bool good() const { return missing_ == 0 && extra_ == 0 && lost_ == 0 && ordered_equals_exhaustive_; }

 private:
  plan search(const posed& query, const std::vector<posed>& neighbours, turbomap::candidates set) {
    turbomap::search_correspondences(scene_.ctx, query, turbomap::span<const posed>(neighbours),
                                     parity_options(scene_.recording, set), matches_);
    return matches_.plan(scene_.ctx);
  }

  recorded_scene<Camera, Policy>& scene_;
  matches matches_;
  std::size_t expected_ = 0, missing_ = 0, extra_ = 0, exhaustive_pairs_ = 0, lost_ = 0;
  bool ordered_equals_exhaustive_ = true;
  truth_counts grouped_truth_, exhaustive_truth_;
};

}  // namespace turbomap_replay
