// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stages that turbomap-bench times against their sequential oracles, interleaved in one run on the same inputs: the last
/// keyframe of a simulated fisheye recording against ten neighbours; map_stages.hpp has those that need a map.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <thrust/execution_policy.h>

#include <nlohmann/json.hpp>

#include "reference/creation_oracle.hpp"
#include "reference/search_oracle.hpp"

#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>

#include "map_stages.hpp"
#include "measure.hpp"
#include "replay/recorded_keyframes.hpp"

namespace turbomap_bench {

/// The last keyframe of a recording and the ten before it, in a store of the policy.
template <class Policy>
class last_keyframes {
 public:
  using memory = turbomap::memory_of_t<Policy>;
  static constexpr std::size_t neighbour_count = 10;

  last_keyframes(const turbomap::recording& recording, const Policy& policy)
      : ctx(policy), store(turbomap_replay::recorded_store_options(recording.meta)) {
    const auto rig = turbomap_replay::recorded_rig<fisheye>(recording.meta);
    const std::size_t first = recording.keyframe_count() - 1 - neighbour_count;
    std::vector<turbomap::keyframe_handle> handles;
    std::vector<turbomap::keypoint> keypoints;
    for (std::size_t k = 0; k <= neighbour_count; ++k) {
      handles.push_back(store.insert(turbomap_replay::recorded_keyframe(recording, first + k, rig, keypoints)));
      const auto range = recording.keypoints(first + k);
      for (std::size_t i = range.begin; i < range.end; ++i) has_point_[k].push_back(recording.sim_track_id[i] >= 0);
    }
    pinned_.emplace(store.pin(ctx, handles));
    for (std::size_t k = 0; k <= neighbour_count; ++k)
      views_.push_back({(*pinned_)[k], turbomap::cast<double>(recording.T_cw[first + k]), has_point_[k]});
  }
  const posed& query() const { return views_.back(); }
  turbomap::span<const posed> neighbours() const { return {views_.data(), neighbour_count}; }

  turbomap::context<Policy> ctx;
  turbomap::keyframe_store<orb, fisheye, memory> store;

 private:
  std::array<std::vector<std::uint8_t>, 1 + neighbour_count> has_point_;
  std::optional<turbomap::pinned_keyframes<orb, fisheye, memory>> pinned_;
  std::vector<posed> views_;
};

/// The last keyframe goes in and out. Its floor: the bytes of a keyframe, written once.
template <class Store, class HostStore>
nlohmann::json time_insertion(const turbomap::recording& recording, Store& store, HostStore& host_store,
                              int repetitions) {
  std::vector<turbomap::keypoint> keypoints;
  const auto rig = turbomap_replay::recorded_rig<fisheye>(recording.meta);
  const auto data = turbomap_replay::recorded_keyframe(recording, recording.keyframe_count() - 1, rig, keypoints);
  std::vector<std::byte> from(static_cast<std::size_t>(store.statistics().bytes_per_keyframe)), to(from.size());
  std::vector<double> copies;
  for (int k = 0; k < 31; ++k) {
    const double begin = now_ms();
    std::copy(from.begin(), from.end(), to.begin());
    from[0] = to.back();
    copies.push_back(now_ms() - begin);
  }
  return interleave(
      repetitions, [&] { store.erase(store.insert(data)); }, [&] { host_store.erase(host_store.insert(data)); },
      median(copies));
}

/// Runs every stage under the policy. Keyframes on the `host` serve the oracle.
template <class Policy>
nlohmann::json run_stages(const Policy& policy, const turbomap::recording& recording, int repetitions) {
  last_keyframes<Policy> resident(recording, policy);
  last_keyframes<thrust::detail::seq_t> host(recording, thrust::seq);
  turbomap::context<Policy>& ctx = resident.ctx;
  nlohmann::json stages;
  stages["insertion"] = time_insertion(recording, resident.store, host.store, repetitions);

  turbomap::correspondences<orb, fisheye, Policy> matches(ctx);
  typename turbomap::correspondences<orb, fisheye, Policy>::plan_type plan;
  const auto options_of = [&](turbomap::candidates set) {
    turbomap::search_options options;
    options.scales = recording.meta.pyramid();
    options.candidate_set = set;
    return options;
  };
  double in_words = 0, consistent = 0;
  count_pairs(host.query(), host.neighbours(), options_of(turbomap::candidates::exhaustive), in_words, consistent);
  const double distance_ms = distance_floor_ms(host.neighbours()[0].view, 1);
  const auto time_search = [&](const char* name, turbomap::candidates set, double pairs) {
    const auto options = options_of(set);
    stages[name] = interleave(
        repetitions,
        [&] {
          turbomap::search_correspondences(ctx, resident.query(), resident.neighbours(), options, matches);
          matches.plan(ctx, plan);
        },
        [&] { turbomap_test::search_oracle(host.query(), host.neighbours(), options); }, distance_ms * pairs);
  };
  time_search("search_grouped", turbomap::candidates::grouped, in_words);
  time_search("search_exhaustive", turbomap::candidates::exhaustive, consistent);
  time_search("search_exact", turbomap::candidates::epipolar_ordered, consistent);

  turbomap::point_creation<Policy> creation(ctx);
  std::vector<turbomap::created_point> points;
  turbomap::creation_options options;
  options.scales = recording.meta.pyramid();
  const auto oracle_matches =
      turbomap_test::search_oracle(host.query(), host.neighbours(), options_of(turbomap::candidates::exhaustive));
  stages["creation"] = interleave(
      repetitions,
      [&] {
        turbomap::create_points(ctx, matches, options, creation);
        creation.plan(ctx, matches, points);
      },
      [&] { turbomap_test::creation_oracle(host.query(), host.neighbours(), oracle_matches, options); }, 0);
  stages["creation"].erase("floor_ms");
  run_map_stages(ctx, recording, repetitions, distance_ms, stages);
  return stages;
}

}  // namespace turbomap_bench
