// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check mode: every stage on every recorded snapshot, compared with what the recorded system did.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <vector>

#include <turbomap/io/recording_snapshot.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/given_correspondences.hpp>
#include <turbomap/matching/point_creation.hpp>

#include "arguments.hpp"
#include "recorded_keyframes.hpp"
#include "true_matches.hpp"

namespace turbomap_replay {

/// Runs the stages on one snapshot after the other and counts.
template <class Camera, class Policy>
class checker {
 public:
  using memory = turbomap::memory_of_t<Policy>;
  using posed = turbomap::posed_keyframe<orb, Camera>;
  using matches = turbomap::correspondences<orb, Camera, Policy>;
  using plan = typename matches::plan_type;

  checker(const turbomap::recording& recording, const Policy& policy)
      : recording_(recording),
        rig_(recorded_rig<Camera>(recording.meta)),
        ctx_(policy),
        store_(recorded_store_options(recording.meta)),
        matches_(ctx_),
        creation_(ctx_) {
    std::vector<turbomap::keypoint> keypoints;
    for (std::size_t i = 0; i < recording.keyframe_count(); ++i)
      handles_.push_back(store_.insert(recorded_keyframe(recording, i, rig_, keypoints)));
  }

  void check(const turbomap::recording_snapshot& snapshot, const arguments& arguments) {
    const auto pinned = store_.pin(ctx_, handles_);
    std::map<std::int32_t, turbomap::rigid_transform<double>> T_cw;
    for (std::size_t i = 0; i < snapshot.kf_alive.size(); ++i)
      T_cw[snapshot.kf_alive[i]] = turbomap::cast<double>(snapshot.kf_T_cw[i]);
    const auto posed_at = [&](std::int32_t k, turbomap::span<const std::uint8_t> mask) {
      return posed{pinned[static_cast<std::size_t>(k)], T_cw.at(k), mask};
    };
    if (arguments.search) check_search(snapshot, posed_at);
    if (arguments.creation) check_creation(snapshot, posed_at);
  }

  outcome result(const arguments& arguments) const {
    outcome o;
    if (arguments.search) {
      o.json["search"] = {{"pairs_expected", expected_}, {"missing", missing_}, {"extra", extra_}};
      o.json["exhaustive"] = {{"pairs", exhaustive_pairs_},
                              {"grouped_queries_lost", lost_},
                              {"ordered_equals_exhaustive", ordered_equals_exhaustive_}};
      if (recording_.has_ground_truth())
        o.json["true_matches"] = {{"grouped", grouped_truth_.json()}, {"exhaustive", exhaustive_truth_.json()}};
      o.good = o.good && missing_ == 0 && extra_ == 0 && lost_ == 0 && ordered_equals_exhaustive_;
    }
    if (arguments.creation) {
      o.json["creation"] = {
          {"pairs", created_}, {"decision_agree", decisions_}, {"max_position_error_m", position_error_}};
      o.good = o.good && decisions_ == created_ && position_error_ <= 1e-3;
    }
    return o;
  }

 private:
  turbomap::search_options parity_options(turbomap::candidates set) const {
    turbomap::search_options o;
    o.candidate_set = set;
    o.ties = turbomap::tie_rule::highest_index;
    o.scales = recording_.meta.pyramid();
    return o;
  }
  plan search(const posed& query, const std::vector<posed>& neighbours, turbomap::candidates set) {
    turbomap::search_correspondences(ctx_, query, turbomap::span<const posed>(neighbours), parity_options(set),
                                     matches_);
    return matches_.plan(ctx_);
  }

  template <class PosedAt>
  void check_search(const turbomap::recording_snapshot& s, PosedAt posed_at) {
    std::vector<posed> neighbours;
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
      if (s.search.skipped[i] != 0) continue;
      neighbours.push_back(posed_at(s.search.neighbours[i], s.mask2(i)));
      rows.push_back(i);
    }
    if (neighbours.empty()) return;
    const posed query = posed_at(s.keyframe, s.mask1(0));

    const plan grouped = search(query, neighbours, turbomap::candidates::grouped);
    std::set<std::array<std::int32_t, 3>> ours, theirs;
    for (const auto& m : grouped) ours.insert({m.neighbour, m.query, m.candidate});
    for (std::size_t n = 0; n < rows.size(); ++n)
      for (const auto& pair : s.batch_pairs(rows[n])) theirs.insert({static_cast<std::int32_t>(n), pair[0], pair[1]});
    expected_ += theirs.size();
    for (const auto& m : theirs)
      if (ours.count(m) == 0) ++missing_, report("search: missing", s, m);
    for (const auto& m : ours)
      if (theirs.count(m) == 0) ++extra_, report("search: extra", s, m);

    const plan exhaustive = search(query, neighbours, turbomap::candidates::exhaustive);
    const plan ordered = search(query, neighbours, turbomap::candidates::epipolar_ordered);
    exhaustive_pairs_ += exhaustive.size();
    const bool equal = std::equal(ordered.begin(), ordered.end(), exhaustive.begin(), exhaustive.end(),
                                  [](const auto& a, const auto& b) {
                                    return a.neighbour == b.neighbour && a.query == b.query &&
                                           a.candidate == b.candidate && a.distance == b.distance;
                                  });
    ordered_equals_exhaustive_ = ordered_equals_exhaustive_ && equal;
    std::map<std::array<std::int32_t, 2>, std::int32_t> distance;
    for (const auto& m : exhaustive) distance[{m.neighbour, m.query}] = m.distance;
    for (const auto& m : grouped) {
      const auto found = distance.find({m.neighbour, m.query});
      lost_ += found == distance.end() || found->second > m.distance ? 1 : 0;
    }
    if (recording_.has_ground_truth()) {
      const true_matches<Camera> truth(recording_, rig_, s);
      grouped_truth_ += truth.judge(grouped, rows);
      exhaustive_truth_ += truth.judge(exhaustive, rows);
    }
  }

  /// Creation is checked on the pairs that the peer found: each neighbour's in one call.
  template <class PosedAt>
  void check_creation(const turbomap::recording_snapshot& s, PosedAt posed_at) {
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i) {
      const auto pairs = s.pairs(i);
      if (pairs.empty()) continue;
      std::vector<typename matches::plan_type::value_type> given;
      for (const auto& pair : pairs) given.push_back({0, pair[0], pair[1], 0});
      const std::vector<posed> neighbour{posed_at(s.search.neighbours[i], {})};
      turbomap::given_correspondences(ctx_, posed_at(s.keyframe, {}), turbomap::span<const posed>(neighbour),
                                      turbomap::span<const typename matches::plan_type::value_type>(given),
                                      parity_options(turbomap::candidates::exhaustive), matches_);
      turbomap::creation_options options;
      options.scales = recording_.meta.pyramid();
      if (recording_.meta.sensor == "inertial") options.max_parallax_cosine = 0.9996;
      turbomap::create_points(ctx_, matches_, options, creation_);
      const auto points = creation_.plan(ctx_, matches_);
      const auto first = static_cast<std::size_t>(s.search.pairs_off[i]);
      created_ += pairs.size();
      for (std::size_t k = 0; k < points.size(); ++k) {
        const std::size_t row = first + k;
        const bool agree = static_cast<int>(points[k].outcome) == s.creation.code[row] &&
                           static_cast<int>(points[k].method) == s.creation.method[row];
        if (agree)
          ++decisions_;
        else
          report("creation: decision differs", s, {static_cast<std::int32_t>(i), pairs[k][0], pairs[k][1]});
        if (s.creation.code[row] == 0) {
          const auto& p = s.creation.position[row];
          position_error_ = std::max(position_error_, turbomap::norm(points[k].position - turbomap::cast<double>(p)));
        }
      }
    }
  }

  static void report(const char* what, const turbomap::recording_snapshot& s, const std::array<std::int32_t, 3>& m) {
    std::printf("%s: snapshot %d neighbour %d keypoints %d %d\n", what, s.iteration, m[0], m[1], m[2]);
  }

  const turbomap::recording& recording_;
  std::vector<turbomap::rig_camera<Camera>> rig_;
  turbomap::context<Policy> ctx_;
  turbomap::keyframe_store<orb, Camera, memory> store_;
  std::vector<turbomap::keyframe_handle> handles_;
  matches matches_;
  turbomap::point_creation<Policy> creation_;
  std::size_t expected_ = 0, missing_ = 0, extra_ = 0, exhaustive_pairs_ = 0, lost_ = 0, created_ = 0, decisions_ = 0;
  bool ordered_equals_exhaustive_ = true;
  double position_error_ = 0;
  truth_counts grouped_truth_, exhaustive_truth_;
};

}  // namespace turbomap_replay
