// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Check of keyframe culling: the counts of every candidate on the unchanged state, then the recorded visit in order,
/// each removal taking effect: counts and decisions.

#include <array>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/mapping/keyframe_culling.hpp>

#include "recorded_map.hpp"
#include "recorded_scene.hpp"

namespace turbomap_replay {

template <class Camera, class Policy>
class culling_check {
 public:
  using map = recorded_map<Camera>;
  using keyframe = typename map::keyframe;
  using status = turbomap::recorded_culling;

  explicit culling_check(recorded_scene<Camera, Policy>& scene) : scene_(scene) {}

  void check(const snapshot_scene<Camera, Policy>& at) {
    if (!at.snapshot().culling) return;
    const turbomap::culling_snapshot& c = *at.snapshot().culling;
    std::vector<std::uint8_t> alive;
    for (std::size_t k = 0; k < scene_.handles.size(); ++k) alive.push_back(at.alive(static_cast<std::int32_t>(k)));
    map state(scene_.recording, c, alive);
    const auto options = parity(c);
    check_counts(at, c, state, options);
    check_decisions(at, c, state, options);
    count_published(c);
    kept_ += state.count_kept();
  }

  void add_json(nlohmann::json& json) const {
    json["culling"] = {{"keyframes", keyframes_},
                       {"count_agree", count_agree_},
                       {"decisions", decisions_},
                       {"decision_agree", decision_agree_},
                       {"sequential_count_agree", sequential_count_agree_},
                       {"culled", culled_},
                       {"culled_by_hand", by_hand_},
                       {"kept_counts_agree", kept_},
                       {"points", points_},
                       {"published_counters_wrong", published_wrong_},
                       {"published_counts_differ", published_differ_}};
  }
  bool good() const {
    return count_agree_ == keyframes_ && decision_agree_ == decisions_ && sequential_count_agree_ == decisions_ &&
           kept_ == points_;
  }

 private:
  turbomap::keyframe_culling_options parity(const turbomap::culling_snapshot& c) const {
    turbomap::keyframe_culling_options o;
    o.redundant_share = c.redundant_share;
    o.max_depth = static_cast<float>(scene_.recording.meta.close_depth);
    o.temporal_guards = c.inertial, o.inertial_initialised = c.imu_initialized;
    return o;
  }

  /// Every candidate on the state of the start; the map's first keyframe was not counted.
  void check_counts(const snapshot_scene<Camera, Policy>& at, const turbomap::culling_snapshot& c, map& state,
                    const turbomap::keyframe_culling_options& options) {
    std::vector<keyframe> scratch;
    for (std::size_t i = 0; i < c.keyframe.size(); ++i) {
      if (c.dry_points[i] < 0) continue;
      ++keyframes_;
      state.count_next(c.keyframe[i]);
      const auto count = turbomap::count_redundant(state, map::name(c.keyframe[i]), options, scratch);
      const bool agree = count.points == c.dry_points[i] && count.redundant == c.dry_redundant[i];
      count_agree_ += agree ? 1 : 0;
      published_differ_ += c.dry_redundant_published[i] != c.dry_redundant[i] ? 1 : 0;
      if (!agree)
        report_difference("culling: counts of keyframe", at.snapshot(), {c.keyframe[i], count.points, count.redundant});
    }
  }

  /// The library's cull_keyframes() one candidate at a time. What it would take out but refuses, because the recorded
  /// lists contradict each other, is taken out by hand with the library's edit.
  void check_decisions(const snapshot_scene<Camera, Policy>& at, const turbomap::culling_snapshot& c, map& state,
                       const turbomap::keyframe_culling_options& options) {
    const keyframe current = map::name(at.snapshot().keyframe);
    std::vector<turbomap::culling_record<keyframe>> records;
    for (std::size_t i = 0; i < c.keyframe.size(); ++i) {
      const keyframe candidate = map::name(c.keyframe[i]);
      ++decisions_;
      state.count_next(c.keyframe[i]);
      records.clear();
      bool erased = false;
      turbomap::redundancy count;
      try {
        turbomap::cull_keyframes(state, current, {&candidate, 1}, options, records, nullptr,
                                 [&state](keyframe k) { state.erase_next(k.index); });
        erased = records[0].verdict == turbomap::culling_verdict::erased;
        count = records[0].count;
      } catch (const turbomap::inconsistent_map&) {  // before anything is changed: the same by its pieces
        std::vector<keyframe> scratch;
        count = turbomap::count_redundant(state, candidate, options, scratch);
        erased = turbomap::is_redundant(count, options) &&
                 !(options.temporal_guards &&
                   turbomap::leaves_gap(state, candidate, turbomap::temporal_state<map>::of(state, current, options),
                                        options));
        if (erased) {
          state.erase_next(c.keyframe[i]);
          turbomap::erase_keyframe(state, candidate, options.fewest_measurements);
          ++by_hand_;
        }
      }
      culled_ += erased ? 1 : 0;
      const bool counted = c.points[i] >= 0;
      const bool same_count = !counted || (count.points == c.points[i] && count.redundant == c.redundant[i]);
      const bool protect = !records.empty() && records[0].verdict == turbomap::culling_verdict::protected_;
      const bool same_decision = erased == (c.status[i] == status::culled) && protect == !counted;
      sequential_count_agree_ += same_count ? 1 : 0;
      decision_agree_ += same_decision ? 1 : 0;
      if (!same_count)
        report_difference("culling: counts in order of keyframe", at.snapshot(),
                          {c.keyframe[i], count.points, count.redundant});
      if (!same_decision)
        report_difference("culling: decision on keyframe, erased, recorded status", at.snapshot(),
                          {c.keyframe[i], erased ? 1 : 0, static_cast<std::int32_t>(c.status[i])});
    }
  }

  /// How far the counters of the published GPU version are off: nothing of ours.
  void count_published(const turbomap::culling_snapshot& c) {
    points_ += c.point.size();
    for (std::size_t p = 0; p < c.point.size(); ++p) {
      std::array<std::int32_t, 8> counts{};
      for (std::size_t o = c.observations(p).begin; o < c.observations(p).end; ++o)
        if (c.obs_octave[o] < counts.size()) ++counts[c.obs_octave[o]];
      published_wrong_ += counts != c.octave_counts[p] ? 1 : 0;
    }
  }

  recorded_scene<Camera, Policy>& scene_;
  std::size_t keyframes_ = 0, count_agree_ = 0, decisions_ = 0, decision_agree_ = 0, sequential_count_agree_ = 0;
  std::size_t culled_ = 0, by_hand_ = 0, kept_ = 0, points_ = 0, published_wrong_ = 0, published_differ_ = 0;
};

}  // namespace turbomap_replay
