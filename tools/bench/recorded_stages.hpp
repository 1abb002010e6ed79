// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The searches of turbomap-bench on recorded inputs: what the recorded system searched in each of its snapshots, with its masks, poses
/// and map points; and the stages of recorded_map_stages.hpp. Milliseconds are those of one snapshot, means over all.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <stdexcept>
#include <vector>

#include <thrust/execution_policy.h>

#include <nlohmann/json.hpp>

#include "reference/creation_oracle.hpp"
#include "reference/projection_oracle.hpp"
#include "reference/search_oracle.hpp"

#include <turbomap/fusion/duplicate_search.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>

#include "map_stages.hpp"
#include "measure.hpp"
#include "recorded_map_stages.hpp"
#include "replay/check_fusion.hpp"
#include "replay/recorded_scene.hpp"

namespace turbomap_bench {

/// The inputs of one snapshot, as the views of a scene give them.
template <class Camera, class Policy>
struct recorded_inputs {
  using posed_type = turbomap::posed_keyframe<orb, Camera>;
  using target = turbomap::duplicate_target<orb, Camera>;
  struct fusion_pass {
    turbomap_replay::gathered_points points;
    std::vector<std::uint8_t> skip;  ///< [target][camera][point]
    std::vector<target> targets;
  };

  recorded_inputs(turbomap_replay::recorded_scene<Camera, Policy>& scene, const turbomap::recording_snapshot& s)
      : at(scene, s), query(at.at(s.keyframe, s.mask1(0))) {
    for (std::size_t i = 0; i < s.search.neighbours.size(); ++i)
      if (s.search.skipped[i] == 0) neighbours.push_back(at.at(s.search.neighbours[i], s.mask2(i)));
    if (!s.fusion) return;
    add_pass(*s.fusion, s.fusion->forward, s.fusion->targets);
    add_pass(*s.fusion, s.fusion->backward, {s.keyframe});
  }
  recorded_inputs(const recorded_inputs&) = delete;
  recorded_inputs& operator=(const recorded_inputs&) = delete;

  turbomap_replay::snapshot_scene<Camera, Policy> at;
  posed_type query;
  std::vector<posed_type> neighbours;
  std::deque<fusion_pass> passes;  ///< targets refer to their pass

 private:
  void add_pass(const turbomap::fusion_snapshot& f, const turbomap::recorded_batch& batch,
                const std::vector<std::int32_t>& keyframes) {
    const std::size_t block = f.cameras * batch.state.size();
    if (block == 0) return;
    passes.push_back({turbomap_replay::gathered_points(f.states, batch.state), {}, {}});
    auto& pass = passes.back();
    // 2, 3: the point was dead, or in the keyframe already.
    for (const std::uint8_t code : batch.found.code) pass.skip.push_back(code == 2 || code == 3 ? 1 : 0);
    for (std::size_t t = 0; t < keyframes.size(); ++t)
      pass.targets.push_back({at.view(keyframes[t]), at.T_cw(keyframes[t]), {pass.skip.data() + t * block, block}});
  }
};

using doubtful_list = std::vector<turbomap_test::doubtful_result>;

/// Whether two lists are the same but for results that hung on a close call: plain double may decide these the other way.
/// \param is_of  whether a result is the doubtful one
template <class T, class Doubtful, class IsOf, class Same>
bool same_where_clear(std::vector<T> a, std::vector<T> b, const std::vector<Doubtful>& doubtful, IsOf is_of,
                      Same same) {
  for (auto* list : {&a, &b})
    list->erase(std::remove_if(list->begin(), list->end(),
                               [&](const T& x) {
                                 return std::any_of(doubtful.begin(), doubtful.end(),
                                                    [&](const Doubtful& d) { return is_of(x, d); });
                               }),
                list->end());
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), same);
}
/// The same of matches and of the points that are made from them, by (neighbour, query keypoint).
template <class T, class Same>
bool same_where_clear(const std::vector<T>& a, const std::vector<T>& b, const doubtful_list& doubtful, Same same) {
  const auto is_of = [](const T& x, const auto& d) { return x.neighbour == d.neighbour && x.query == d.query; };
  const auto both = [&](const T& x, const T& y) {
    return x.neighbour == y.neighbour && x.query == y.query && x.candidate == y.candidate && same(x, y);
  };
  return same_where_clear(a, b, doubtful, is_of, both);
}

/// Times of a whole recording as those of one snapshot.
inline nlohmann::json per_snapshot(nlohmann::json times, std::size_t snapshots) {
  for (const char* key : {"ms_median", "oracle_ms_median", "floor_ms"})
    times[key] = times[key].get<double>() / static_cast<double>(snapshots);
  times["snapshots"] = snapshots;
  return times;
}

/// The stages on every snapshot of a recording. `host` views serve the oracles, `resident` ones the policy.
template <class Camera, class Policy>
class recorded_stages {
  using host_policy = thrust::detail::seq_t;
  using posed_type = turbomap::posed_keyframe<orb, Camera>;
  using target = turbomap::duplicate_target<orb, Camera>;
  using found_duplicates = turbomap::duplicates<orb, Camera, Policy>;

 public:
  recorded_stages(const Policy& policy, const turbomap::recording& recording, const std::string& folder,
                  int repetitions)
      : recording_(recording),
        repetitions_(repetitions),
        scene_(recording, policy),
        host_scene_(recording, thrust::seq),
        matches_(scene_.ctx) {
    for (const std::int32_t iteration : recording.meta.snapshots) {
      snapshots_.push_back(turbomap::read_snapshot(recording, folder, iteration));
      resident_.emplace_back(scene_, snapshots_.back());
      host_.emplace_back(host_scene_, snapshots_.back());
    }
    if (snapshots_.empty()) throw std::runtime_error(folder + ": has no snapshots");
    distance_ms_ = distance_floor_ms(host_[0].query.view, 1);
  }

  nlohmann::json run() {
    time_searches();
    time_creation();
    time_map_stages();
    time_duplicates();
    return stages_;
  }

 private:
  turbomap::search_options options_of(turbomap::candidates set) const {
    turbomap::search_options options;
    options.scales = recording_.meta.pyramid();
    options.candidate_set = set;
    return options;
  }
  void search(std::size_t s, turbomap::candidates set) {
    turbomap::search_correspondences(scene_.ctx, resident_[s].query,
                                     turbomap::span<const posed_type>(resident_[s].neighbours), options_of(set),
                                     matches_);
    matches_.plan(scene_.ctx, plan_);
  }
  auto search_by_definition(std::size_t s, turbomap::candidates set, doubtful_list* doubtful = nullptr) const {
    return turbomap_test::search_oracle(host_[s].query, turbomap::span<const posed_type>(host_[s].neighbours),
                                        options_of(set), doubtful);
  }
  void time_searches() {
    double in_words = 0, consistent = 0;
    for (const auto& inputs : host_)
      count_pairs(inputs.query, turbomap::span<const posed_type>(inputs.neighbours),
                  options_of(turbomap::candidates::exhaustive), in_words, consistent);
    time_search("search_grouped", turbomap::candidates::grouped, in_words);
    time_search("search_exact", turbomap::candidates::epipolar_ordered, consistent);
  }
  /// \param pairs  that have to be compared at least
  void time_search(const char* name, turbomap::candidates set, double pairs) {
    for (std::size_t s = 0; s < snapshots_.size(); ++s) {
      search(s, set);
      doubtful_list doubtful;
      const auto expected = search_by_definition(s, set, &doubtful);
      require_same(
          same_where_clear(expected, plan_, doubtful, [](auto& a, auto& b) { return a.distance == b.distance; }), name);
    }
    const auto ours = [&] {
      for (std::size_t s = 0; s < snapshots_.size(); ++s) search(s, set);
    };
    const auto oracle = [&] {
      for (std::size_t s = 0; s < snapshots_.size(); ++s) search_by_definition(s, set);
    };
    stages_[name] = per_snapshot(interleave(repetitions_, ours, oracle, distance_ms_ * pairs), snapshots_.size());
  }

  /// Each snapshot's matches stay while its points are created again and again.
  void time_creation() {
    turbomap::point_creation<Policy> creation(scene_.ctx);
    std::vector<turbomap::created_point> points;
    turbomap::creation_options options;
    options.scales = recording_.meta.pyramid();
    nlohmann::json sum = nlohmann::json::object();
    for (std::size_t s = 0; s < snapshots_.size(); ++s) {
      search(s, turbomap::candidates::epipolar_ordered);
      const auto create = [&] {
        turbomap::create_points(scene_.ctx, matches_, options, creation);
        creation.plan(scene_.ctx, matches_, points);
      };
      const auto create_by_definition = [&](doubtful_list* doubtful = nullptr) {
        return turbomap_test::creation_oracle(host_[s].query, turbomap::span<const posed_type>(host_[s].neighbours),
                                              plan_, options, doubtful);
      };
      create();
      doubtful_list doubtful;
      const auto expected = create_by_definition(&doubtful);
      require_same(same_where_clear(expected, points, doubtful,
                                    [](auto& a, auto& b) { return a.outcome == b.outcome && a.method == b.method; }),
                   "creation");
      const nlohmann::json one = interleave(
          repetitions_, create, [&] { create_by_definition(); }, 0);
      for (const char* key : {"ms_median", "oracle_ms_median", "floor_ms"})
        sum[key] = sum.value(key, 0.0) + one[key].get<double>();
    }
    sum["ratio"] = sum["oracle_ms_median"].get<double>() / sum["ms_median"].get<double>();
    stages_["creation"] = per_snapshot(sum, snapshots_.size());
    stages_["creation"].erase("floor_ms");
  }

  void time_map_stages() {
    std::vector<recorded_update<Camera>> updates;
    std::vector<culled_map<Camera>> maps;
    for (std::size_t s = 0; s < snapshots_.size(); ++s) {
      const turbomap::recording_snapshot& snapshot = snapshots_[s];
      if (snapshot.map_update) updates.emplace_back(snapshot, resident_[s].at, host_[s].at, scene_.handles.size());
      if (snapshot.culling) maps.emplace_back(recording_, snapshot);
    }
    if (!updates.empty())
      stages_["map_update"] =
          per_snapshot(time_recorded_update(scene_, updates, repetitions_, distance_ms_), updates.size());
    if (maps.empty()) return;
    const auto close_depth = static_cast<float>(recording_.meta.close_depth);
    stages_["culling"] = per_snapshot(time_recorded_culling(maps, close_depth, repetitions_), maps.size());
    stages_["point_culling"] = per_snapshot(time_recorded_point_culling(maps, repetitions_), maps.size());
  }

  turbomap::duplicate_options fusion_options() const {
    turbomap::duplicate_options options;
    options.scales = recording_.meta.pyramid();
    options.min_range_factor = 1;  // recorded minima include the factor
    return options;
  }
  template <class Pass>
  auto find_by_definition(const Pass& pass) const {
    return turbomap_test::projection_oracle<orb, Camera>(pass.points.view(), turbomap::span<const target>(pass.targets),
                                                         fusion_options());
  }
  /// Compares what was found in a pass with its definition. \return how many duplicates that has
  template <class Pass, class Found>
  std::size_t require_same_duplicates(const Pass& pass, const Found& found) const {
    const auto trials = find_by_definition(pass);
    Found expected, doubtful;
    std::size_t i = 0;
    for (std::int32_t t = 0; t < static_cast<std::int32_t>(pass.targets.size()); ++t)
      for (std::int32_t c = 0; c < pass.targets[static_cast<std::size_t>(t)].view.camera_count; ++c)
        for (std::int32_t point = 0; point < pass.points.view().count; ++point, ++i) {
          const auto& trial = trials[i].trial;
          if (trials[i].doubtful) doubtful.push_back({t, c, point, -1, 0});
          if (trial.outcome == turbomap::projection_outcome::matched)
            expected.push_back({t, c, point, trial.keypoint, trial.distance});
        }
    const auto same_place = [](auto& a, auto& b) {
      return a.target == b.target && a.camera == b.camera && a.point == b.point;
    };
    const auto same = [&](auto& a, auto& b) { return same_place(a, b) && a.keypoint == b.keypoint; };
    require_same(same_where_clear(expected, found, doubtful, same_place, same), "duplicates");
    return expected.size();
  }
  void time_duplicates() {
    found_duplicates duplicates(scene_.ctx);
    typename found_duplicates::plan_type found;
    const auto find = [&](const auto& pass) {
      turbomap::find_duplicates(scene_.ctx, pass.points.view(), turbomap::span<const target>(pass.targets),
                                fusion_options(), duplicates);
      duplicates.plan(scene_.ctx, found);
    };
    stage_floor floor;
    std::size_t passes = 0;
    for (std::size_t s = 0; s < snapshots_.size(); ++s)
      for (std::size_t p = 0; p < resident_[s].passes.size(); ++p, ++passes) {
        const auto& pass = host_[s].passes[p];
        find(resident_[s].passes[p]);
        floor.distances += static_cast<double>(require_same_duplicates(pass, found));
        for (const std::uint8_t skip : pass.skip) floor.transforms += skip == 0 ? 1 : 0;
      }
    if (passes == 0) return;
    const auto ours = [&] {
      for (const auto& inputs : resident_)
        for (const auto& pass : inputs.passes) find(pass);
    };
    const auto oracle = [&] {
      for (const auto& inputs : host_)
        for (const auto& pass : inputs.passes) find_by_definition(pass);
    };
    stages_["duplicates"] =
        per_snapshot(interleave(repetitions_, ours, oracle, floor.ms(distance_ms_)), snapshots_.size());
  }

  const turbomap::recording& recording_;
  int repetitions_;
  turbomap_replay::recorded_scene<Camera, Policy> scene_;
  turbomap_replay::recorded_scene<Camera, host_policy> host_scene_;
  std::deque<turbomap::recording_snapshot> snapshots_;
  std::deque<recorded_inputs<Camera, Policy>> resident_;
  std::deque<recorded_inputs<Camera, host_policy>> host_;
  double distance_ms_ = 0;  ///< of one descriptor distance in a stream
  turbomap::correspondences<orb, Camera, Policy> matches_;
  typename turbomap::correspondences<orb, Camera, Policy>::plan_type plan_;
  nlohmann::json stages_;
};

}  // namespace turbomap_bench
