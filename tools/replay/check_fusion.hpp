// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of the search for duplicates and of what is decided about each: the recorded batches (all targets on one
/// state), then the recorded calls one after the other, entry by entry.

#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/fusion/duplicate_search.hpp>
#include <turbomap/mapping/fusion_commit.hpp>

#include "recorded_scene.hpp"

namespace turbomap_replay {

/// Recorded point states as one call of the search takes them.
class gathered_points {
 public:
  gathered_points(const turbomap::recorded_states& states, turbomap::span<const std::int32_t> rows) {
    for (const std::int32_t row : rows) {
      const std::size_t r = row < 0 ? 0 : static_cast<std::size_t>(row);  // nothing is known: it will be skipped
      position_.push_back(turbomap::cast<double>(states.position[r]));
      normal_.push_back(states.normal[r]);
      min_distance_.push_back(states.min_distance[r]);
      max_distance_.push_back(states.raw_max_distance[r]);
      descriptor_.push_back(states.descriptor[r]);
    }
  }
  turbomap::map_point_view<orb> view() const {
    turbomap::map_point_view<orb> v;
    v.count = static_cast<int>(position_.size());
    v.position = position_.data(), v.normal = normal_.data();
    v.min_distance = min_distance_.data(), v.max_distance = max_distance_.data();
    v.descriptor = descriptor_.empty() ? nullptr : descriptor_.data()->data();
    return v;
  }

 private:
  std::vector<turbomap::vec3<double>> position_;
  std::vector<turbomap::vec3<float>> normal_;
  std::vector<float> min_distance_, max_distance_;
  std::vector<turbomap::descriptor_bytes> descriptor_;
};

template <class Camera, class Policy>
class fusion_check {
 public:
  using target = turbomap::duplicate_target<orb, Camera>;
  using result = turbomap::duplicates<orb, Camera, Policy>;
  using trial = typename result::trials_type::value_type;

  explicit fusion_check(recorded_scene<Camera, Policy>& scene) : scene_(scene), duplicates_(scene.ctx) {
    options_.scales = scene.recording.meta.pyramid();
    options_.min_range_factor = 1;  // recorded minima include the factor, 0.8; maxima are taken without theirs
  }

  void check(const snapshot_scene<Camera, Policy>& at) {
    if (!at.snapshot().fusion) return;
    const turbomap::fusion_snapshot& f = *at.snapshot().fusion;
    check_batch(at, f, f.forward, f.targets);
    check_batch(at, f, f.backward, {at.snapshot().keyframe});
    for (std::size_t call = 0; call < f.calls.keyframe.size(); ++call) check_call(at, f, call);
  }

  void add_json(nlohmann::json& json) const {
    json["fusion"] = {{"entries", batch_.entries},
                      {"code_agree", batch_.code},
                      {"index_agree", batch_.index},
                      {"distance_agree", batch_.distance},
                      {"level_agree", batch_.level},
                      {"from_record", batch_.from_record},
                      {"matched_entries", batch_.matched},
                      {"matched_agree", batch_.matched_agree},
                      {"plan_equals_trials", plan_equals_trials_},
                      {"sequential_entries", calls_.entries},
                      {"sequential_agree", calls_agree_},
                      {"sequential_from_record", calls_.from_record},
                      {"sequential_matched_entries", calls_.matched},
                      {"sequential_matched_agree", calls_matched_agree_},
                      {"sequential_actions_from_record", actions_from_record_}};
  }
  bool good() const {
    return batch_.code == batch_.entries && batch_.index == batch_.entries && batch_.distance == batch_.entries &&
           batch_.level == batch_.entries && batch_.matched_agree == batch_.matched && plan_equals_trials_ &&
           calls_agree_ == calls_.entries && calls_matched_agree_ == calls_.matched;
  }

 private:
  /// Recorded codes that no search can know: the point is dead, or in the keyframe already, by lists that are not
  /// recorded.
  static bool is_from_record(std::uint8_t code) { return code == 2 || code == 3; }

  struct counts {
    std::size_t entries = 0, code = 0, index = 0, distance = 0, level = 0, from_record = 0, matched = 0,
                matched_agree = 0;

    /// Counts one entry; true if all of it agrees.
    bool add(const trial& ours, const turbomap::recorded_trials& theirs, std::size_t row) {
      const std::uint8_t recorded = theirs.code[row];
      const auto expected = is_from_record(recorded) ? turbomap::duplicate_outcome::skipped
                                                     : static_cast<turbomap::duplicate_outcome>(recorded);
      const bool same_code = ours.outcome == expected, same_index = ours.keypoint == theirs.keypoint[row],
                 same_distance = ours.distance == theirs.distance[row], same_level = ours.level == theirs.level[row];
      const bool same = same_code && same_index && same_distance && same_level;
      ++entries;
      code += same_code ? 1 : 0, index += same_index ? 1 : 0, distance += same_distance ? 1 : 0;
      level += same_level ? 1 : 0, from_record += is_from_record(recorded) ? 1 : 0;
      matched += recorded == 0 ? 1 : 0, matched_agree += recorded == 0 && same ? 1 : 0;
      return same;
    }
  };

  /// All points in all cameras of all keyframes in one call.
  void check_batch(const snapshot_scene<Camera, Policy>& at, const turbomap::fusion_snapshot& f,
                   const turbomap::recorded_batch& batch, const std::vector<std::int32_t>& keyframes) {
    const std::size_t block = f.cameras * batch.state.size();
    if (block == 0 || keyframes.empty()) return;
    std::vector<std::uint8_t> skip;
    for (const std::uint8_t code : batch.found.code) skip.push_back(is_from_record(code) ? 1 : 0);
    std::vector<target> targets;
    for (std::size_t t = 0; t < keyframes.size(); ++t)
      targets.push_back({at.view(keyframes[t]), at.T_cw(keyframes[t]), {skip.data() + t * block, block}});
    const gathered_points points(f.states, batch.state);
    const auto trials = search(points, targets);
    for (std::size_t row = 0; row < trials.size(); ++row)
      if (!batch_.add(trials[row], batch.found, row))
        report_difference(
            "fusion: keyframe, point, camera", at.snapshot(),
            {keyframes[row / block], f.states.point[static_cast<std::size_t>(batch.state[row % batch.state.size()])],
             static_cast<std::int32_t>(row % block / batch.state.size())});
    plan_equals_trials_ = plan_equals_trials_ && plan_equals(points, targets, trials, batch.state.size(), f.cameras);
  }

  std::vector<trial> search(const gathered_points& points, const std::vector<target>& targets) {
    options_.keep_trials = true;
    turbomap::find_duplicates(scene_.ctx, points.view(), turbomap::span<const target>(targets), options_, duplicates_);
    return duplicates_.trials(scene_.ctx);
  }

  /// What a search gives that does not keep its trials, and rejects in an order of its own.
  bool plan_equals(const gathered_points& points, const std::vector<target>& targets, const std::vector<trial>& trials,
                   std::size_t count, std::size_t cameras) {
    options_.keep_trials = false;
    turbomap::find_duplicates(scene_.ctx, points.view(), turbomap::span<const target>(targets), options_, duplicates_);
    const auto plan = duplicates_.plan(scene_.ctx);
    std::size_t next = 0;
    for (std::size_t row = 0; row < trials.size(); ++row) {
      if (trials[row].outcome != turbomap::duplicate_outcome::matched) continue;
      if (next == plan.size()) return false;
      const auto& entry = plan[next++];
      const std::size_t at =
          (static_cast<std::size_t>(entry.target) * cameras + static_cast<std::size_t>(entry.camera)) * count +
          static_cast<std::size_t>(entry.point);
      if (at != row || entry.keypoint != trials[row].keypoint || entry.distance != trials[row].distance) return false;
    }
    return next == plan.size();
  }

  /// The entries of one recorded call on the states that the points had when their turn came, and the action on each.
  void check_call(const snapshot_scene<Camera, Policy>& at, const turbomap::fusion_snapshot& f, std::size_t call) {
    const auto rows = turbomap::offset_rows(f.calls.off, call);
    const std::size_t count = rows.size(), camera = f.calls.right[call];
    if (count == 0) return;
    std::vector<std::uint8_t> skip(f.cameras * count, 1);
    for (std::size_t i = 0; i < count; ++i)
      skip[camera * count + i] = is_from_record(f.calls.found.code[rows.begin + i]) ? 1 : 0;
    const std::int32_t keyframe = f.calls.keyframe[call];
    const std::vector<target> targets{{at.view(keyframe), at.T_cw(keyframe), skip}};
    const auto trials = search(gathered_points(f.states, turbomap::slice(f.calls.state, rows)), targets);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t row = rows.begin + i;
      const bool found = calls_.add(trials[camera * count + i], f.calls.found, row);
      const bool agree = found && action_agrees(f.calls, row);
      calls_agree_ += agree ? 1 : 0;
      calls_matched_agree_ += agree && f.calls.found.code[row] == 0 ? 1 : 0;
      if (!agree)
        report_difference("fusion in order: call, entry, recorded action", at.snapshot(),
                          {static_cast<std::int32_t>(call), static_cast<std::int32_t>(i), f.calls.action[row]});
    }
  }

  /// What is decided about a match, by the observation counts on record. That the keypoint's point is dead is taken
  /// from it.
  bool action_agrees(const turbomap::recorded_calls& calls, std::size_t row) {
    constexpr std::uint8_t keypoints_point_is_dead = 4;
    const std::uint8_t recorded = calls.action[row];
    if (calls.found.code[row] != 0) return recorded == static_cast<std::uint8_t>(turbomap::fusion_action::none);
    if (recorded == keypoints_point_is_dead) return ++actions_from_record_, true;
    const int holder = calls.slot_point[row] < 0 ? -1 : calls.slot_observations[row];
    return recorded == static_cast<std::uint8_t>(turbomap::fusion_decision(calls.observations[row], holder));
  }

  recorded_scene<Camera, Policy>& scene_;
  result duplicates_;
  turbomap::duplicate_options options_;
  counts batch_, calls_;
  std::size_t calls_agree_ = 0, calls_matched_agree_ = 0, actions_from_record_ = 0;
  bool plan_equals_trials_ = true;
};

}  // namespace turbomap_replay
