// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Judges the correspondences of a replay: how many are right by the simulator's ids, and whether the kinds of candidates
/// agree with each other, for recordings without snapshots.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <turbomap/io/recording.hpp>
#include <turbomap/local_mapper.hpp>

#include "reference/same_plans.hpp"

namespace turbomap_replay {

struct match_verdict {
  std::size_t matches = 0, correct_matches = 0;
  std::size_t pairs = 0, grouped_queries_lost = 0;
  std::size_t grouped_pairs = 0, grouped_correct = 0;
  bool ordered_equals_exhaustive = true;
};

template <class Map, class Policy>
class match_judge {
 public:
  using matching = turbomap::neighbour_search<Map, Policy>;
  using plan_type = typename matching::matches_type::plan_type;

  match_judge(const turbomap::recording& recording, turbomap::context<Policy>& ctx)
      : recording_(recording), ctx_(ctx), again_(ctx) {}

  /// After a search. \param keyframes  indices in the recording of the query and its neighbours
  /// \param compare  search again with every kind of candidates
  void operator()(const matching& found, const std::vector<std::int32_t>& keyframes, turbomap::search_options options,
                  bool compare) {
    const plan_type plan = found.matches().plan(ctx_);
    verdict_.matches += plan.size();
    verdict_.correct_matches += count_correct(keyframes, plan);
    if (!compare || keyframes.size() < 2) return;
    const auto search = [&](turbomap::candidates set) {
      options.candidate_set = set;
      found.compute_again(ctx_, options, again_);
      return again_.plan(ctx_);
    };
    const plan_type exhaustive = search(turbomap::candidates::exhaustive);
    const plan_type ordered = search(turbomap::candidates::epipolar_ordered);
    const plan_type grouped = search(turbomap::candidates::grouped);
    verdict_.pairs += exhaustive.size();
    verdict_.grouped_pairs += grouped.size();
    verdict_.grouped_correct += count_correct(keyframes, grouped);
    verdict_.ordered_equals_exhaustive = verdict_.ordered_equals_exhaustive && turbomap_test::same(ordered, exhaustive);
    for (const auto& g : grouped) {
      const auto at = std::lower_bound(exhaustive.begin(), exhaustive.end(), g, [](const auto& a, const auto& b) {
        return a.neighbour != b.neighbour ? a.neighbour < b.neighbour : a.query < b.query;
      });
      const bool kept =
          at != exhaustive.end() && at->neighbour == g.neighbour && at->query == g.query && at->distance <= g.distance;
      verdict_.grouped_queries_lost += kept ? 0 : 1;
    }
  }
  const match_verdict& verdict() const { return verdict_; }

 private:
  std::size_t count_correct(const std::vector<std::int32_t>& keyframes, const plan_type& plan) const {
    if (!recording_.is_simulated()) return 0;
    const auto truth = [&](std::int32_t keyframe, std::int32_t keypoint) {
      return recording_.sim_point_id[static_cast<std::size_t>(recording_.kp_off[static_cast<std::size_t>(keyframe)]) +
                                     static_cast<std::size_t>(keypoint)];
    };
    std::size_t correct = 0;
    for (const auto& m : plan) {
      const std::int32_t a = truth(keyframes[0], m.query);
      // The last neighbour may be the query itself: search_options::across_rig.
      const std::size_t neighbour = (static_cast<std::size_t>(m.neighbour) + 1) % keyframes.size();
      const std::int32_t b = truth(keyframes[neighbour], m.candidate);
      correct += a >= 0 && a == b ? 1 : 0;
    }
    return correct;
  }

  const turbomap::recording& recording_;
  turbomap::context<Policy>& ctx_;
  typename matching::matches_type again_;
  match_verdict verdict_;
};

}  // namespace turbomap_replay
