// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Duplicate search and fusion on a recorded map with known poses, judged by the map's own observations: keypoints at which
/// the source has two landmarks are duplicates for certain; landmarks that one keyframe sees at two keypoints are not.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <turbomap/map/neighbourhood.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/duplicate_fusion.hpp>
#include <vector>

#include "fusion_verdict.hpp"
#include "landmark_map.hpp"
#include "statistics.hpp"

namespace turbomap::evaluation {

class fusion_evaluator {
 public:
  using map_type = landmark_map::map_type;
  using traits = landmark_map::traits;
  using descriptor = landmark_map::descriptor;

  fusion_evaluator(const keyframe_map& source, const fusion_evaluation_options& options)
      : options_(options.fusion()), world_(source), observations_(world_.map.observation_count()) {}

  /// The withheld landmark of every pair is looked for in the pair's keyframe, and fused. Call one of the two, once.
  pair_evaluation pairs() {
    pair_evaluation result;
    result.pairs = world_.pairs().size();
    std::map<std::size_t, std::vector<landmark_pair>> by_keyframe;
    for (const landmark_pair& pair : world_.pairs()) by_keyframe[pair.keyframe].push_back(pair);
    for (const auto& [keyframe, pairs] : by_keyframe) look_for(keyframe, pairs, result);
    judge(result.verdict);
    return result;
  }

  /// Every keyframe against its covisible ones, in the order of time: its points in theirs and theirs in it.
  fusion_verdict whole_map() {
    fusion_verdict verdict;
    duplicate_fusion<map_type, landmark_map::policy> fusion(world_.ctx);
    neighbourhood<map_type> around;
    guard_times unused;
    for (const map_keyframe_id k : world_.keyframes()) {
      const std::vector<map_keyframe_id> targets = around.targets(world_.map, k, {});
      const span<const map_keyframe_id> all(targets);
      fusion.begin();
      const mapping_scope scope{world_.ctx, world_.map, world_.store, world_.stored, unused};
      verdict.summary += fusion.forward(scope, k, all, options_);
      verdict.summary += fusion.backward(scope, k, all, options_);
      world_.update_appearance(fusion.touched());
    }
    judge(verdict);
    return verdict;
  }

 private:
  void look_for(std::size_t keyframe, const std::vector<landmark_pair>& pairs, pair_evaluation& result) {
    duplicate_snapshot<map_type> snapshot;
    std::vector<landmark_pair> searched;
    for (const landmark_pair& pair : pairs) {
      const map_point_id p = world_.point_of(pair.withheld);
      if (p == map_point_id{}) {
        ++result.cause[static_cast<std::size_t>(pair_cause::unseen)];
        continue;
      }
      snapshot.add_point(world_.map, p);
      searched.push_back(pair);
    }
    const map_keyframe_id target = world_.keyframes()[keyframe];
    const std::vector<keyframe_handle> handles{world_.stored.at(traits::id(world_.map, target))};
    const auto pinned = world_.store.pin(world_.ctx, handles);
    using target_type = duplicate_target<descriptor, landmark_map::camera_type>;
    const std::vector<target_type> targets{{pinned[0], world_.map.T_cw(target), {}}};
    auto search = options_.search;
    search.keep_trials = true;
    const auto found = find_duplicates(world_.ctx, snapshot.points_view(), span<const target_type>(targets), search);
    const auto trials = found.trials(world_.ctx);
    for (std::size_t i = 0; i < searched.size(); ++i) explain(searched[i], pinned[0], trials[i], result);
    const auto plan = found.plan(world_.ctx);
    fusion_commit<map_type> commit;
    result.verdict.summary +=
        commit(world_.map, span<const duplicate<std::int32_t>>(plan), span<const map_keyframe_id>(&target, 1),
               span<const map_point_id>(snapshot.points()), options_.commit);
  }

  /// In plain arithmetic and without the search.
  template <class View>
  void explain(const landmark_pair& pair, const View& view, const duplicate_trial<std::int32_t>& trial,
               pair_evaluation& result) {
    ++result.outcome[static_cast<std::size_t>(trial.outcome)];
    const auto own = static_cast<int>(pair.keypoint);
    const bool matched = trial.outcome == duplicate_outcome::matched;
    result.elsewhere += matched && trial.keypoint != own;
    const auto* seen = traits::descriptor_data(world_.map, world_.point_of(pair.withheld));
    const int distance = descriptor::distance(seen, view.descriptor_of(own));
    const vec2<double> error = error_px(pair.keyframe, pair.keypoint, position_of(pair.withheld));
    const double error2 = error.x * error.x + error.y * error.y;
    result.error_px.push_back(std::sqrt(error2));
    result.distance.push_back(distance);
    const auto& o = options_.search;
    const bool in_view = trial.outcome != duplicate_outcome::behind && trial.outcome != duplicate_outcome::outside &&
                         trial.outcome != duplicate_outcome::oblique;
    const bool in_gate = std::abs(error.x) < o.radius && std::abs(error.y) < o.radius && error2 <= o.mono_chi2;
    const pair_cause cause = !in_view                    ? pair_cause::turned
                             : !in_gate                  ? pair_cause::misplaced
                             : distance > o.max_distance ? pair_cause::unlike
                             : trial.keypoint != own     ? pair_cause::lost
                                                         : pair_cause::found;
    ++result.cause[static_cast<std::size_t>(cause)];
  }

  /// The final map by its own observations, and by those of the source.
  void judge(fusion_verdict& verdict) const {
    verdict.faults = validate(world_.map).size();
    verdict.observations_before = observations_;
    verdict.observations_after = world_.map.observation_count();
    traits::for_each_point(world_.map, [&](map_point_id p) {
      std::set<std::int32_t> observers;
      for (const observation& o : world_.map.observations(p)) observers.insert(o.keyframe);
      verdict.seen_twice += observers.size() != world_.map.observations(p).size();
    });
    for (const landmark_pair& pair : world_.pairs())
      verdict.confirmed += point_now(pair.held) != map_point_id{} && point_now(pair.held) == point_now(pair.withheld);
    std::map<std::int32_t, std::vector<std::int32_t>> landmarks_of;  // by the survivor's place
    const auto count = static_cast<std::int32_t>(world_.source().landmarks.size());
    for (std::int32_t l = 0; l < count; ++l)
      if (point_now(l) != map_point_id{}) landmarks_of[point_now(l).index].push_back(l);
    for (const auto& [unused, landmarks] : landmarks_of)
      for (const std::int32_t l : landmarks) {
        if (world_.point_of(l) != point_now(l)) measure_joined(l, verdict);
        for (const std::int32_t other : landmarks)
          if (other < l) look_for_contradiction(l, other, verdict);
      }
  }
  void measure_joined(std::int32_t landmark, fusion_verdict& verdict) const {
    std::vector<double> survivor, own;
    for (const auto& [k, i] : world_.seen_at(landmark)) {
      survivor.push_back(distance_px(k, i, world_.map.position(point_now(landmark))));
      own.push_back(distance_px(k, i, position_of(landmark)));
    }
    verdict.survivor_px.push_back(median(survivor)), verdict.own_px.push_back(median(own));
    const bool certain = std::any_of(world_.pairs().begin(), world_.pairs().end(), [&](const landmark_pair& pair) {
      return (pair.held == landmark && world_.point_of(pair.withheld) == point_now(landmark)) ||
             (pair.withheld == landmark && world_.point_of(pair.held) == point_now(landmark));
    });
    if (certain) verdict.certain_survivor_px.push_back(median(survivor));
  }
  void look_for_contradiction(std::int32_t a, std::int32_t b, fusion_verdict& verdict) const {
    const auto told = [&](std::int32_t l, const landmark_map::view& v) {
      return std::none_of(world_.pairs().begin(), world_.pairs().end(), [&](const landmark_pair& pair) {
        return pair.withheld == l && pair.keyframe == v.first && pair.keypoint == v.second;
      });
    };
    double apart = -1;
    bool known = false;
    for (const auto& v : world_.seen_at(a))
      for (const auto& w : world_.seen_at(b)) {
        if (v.first != w.first || v.second == w.second) continue;
        const auto& pixels = world_.of_source(v.first).pixels;
        const vec2<float>&p = pixels[v.second], &q = pixels[w.second];
        apart = std::max(apart, static_cast<double>(std::hypot(p.x - q.x, p.y - q.y)));
        known = known || (told(a, v) && told(b, w));
      }
    if (apart >= 0) verdict.contradiction_px.push_back(apart);
    verdict.contradictions_known += known;
  }

  map_point_id point_now(std::int32_t landmark) const { return resolve(world_.map, world_.point_of(landmark)); }
  const vec3<double>& position_of(std::int32_t landmark) const {
    return world_.source().landmarks[static_cast<std::size_t>(landmark)].position;
  }
  double distance_px(std::size_t keyframe, std::size_t keypoint, const vec3<double>& position) const {
    const vec2<double> error = error_px(keyframe, keypoint, position);
    return std::hypot(error.x, error.y);
  }
  /// Keypoint minus projection; infinite where the position does not project.
  vec2<double> error_px(std::size_t keyframe, std::size_t keypoint, const vec3<double>& position) const {
    const map_keyframe& k = world_.of_source(keyframe);
    vec2<double> pixel{};
    if (!world_.source().camera.project(to_isometry<double>(k.T_cw) * position, pixel)) return {HUGE_VAL, HUGE_VAL};
    return {static_cast<double>(k.pixels[keypoint].x) - pixel.x, static_cast<double>(k.pixels[keypoint].y) - pixel.y};
  }

  fusion_options options_;
  landmark_map world_;
  std::size_t observations_;  ///< of the map before anything was fused
};

}  // namespace turbomap::evaluation
