// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The stages that turbomap-bench times against their sequential oracles, interleaved in one run on the same inputs: the last
/// keyframe of a simulated fisheye recording against ten neighbours; map_stages.hpp has those that need a map.

#include <algorithm>
#include <string>
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

/// Runs every stage under the policy. `host` views serve the oracle, `resident` ones the policy.
template <class Policy>
nlohmann::json run_stages(const Policy& policy, const turbomap::recording& recording, int repetitions) {
  using memory = turbomap::memory_of_t<Policy>;
  constexpr std::size_t neighbour_count = 10;
  const auto rig = turbomap_replay::recorded_rig<fisheye>(recording.meta);
  turbomap::context<Policy> ctx(policy);
  turbomap::context<thrust::detail::seq_t> host(thrust::seq);
  turbomap::keyframe_store<orb, fisheye, memory> store(turbomap_replay::recorded_store_options(recording.meta));
  turbomap::keyframe_store<orb, fisheye> host_store(turbomap_replay::recorded_store_options(recording.meta));
  std::vector<turbomap::keyframe_handle> handles, host_handles;
  std::vector<std::vector<std::uint8_t>> masks;
  std::vector<turbomap::rigid_transform<double>> T_cw;
  std::vector<turbomap::keypoint> keypoints;
  const std::size_t last = recording.keyframe_count() - 1;
  for (std::size_t i = last - neighbour_count; i <= last; ++i) {
    const auto data = turbomap_replay::recorded_keyframe(recording, i, rig, keypoints);
    handles.push_back(store.insert(data));
    host_handles.push_back(host_store.insert(data));
    T_cw.push_back(turbomap::cast<double>(recording.T_cw[i]));
    masks.emplace_back();
    const auto range = recording.keypoints(i);
    for (std::size_t k = range.begin; k < range.end; ++k) masks.back().push_back(recording.sim_track_id[k] >= 0);
  }
  const auto pinned = store.pin(ctx, handles);
  const auto host_pinned = host_store.pin(host, host_handles);
  std::vector<posed> resident, plain;
  for (std::size_t k = 0; k <= neighbour_count; ++k) {
    resident.push_back({pinned[k], T_cw[k], masks[k]});
    plain.push_back({host_pinned[k], T_cw[k], masks[k]});
  }
  const posed query = resident.back(), plain_query = plain.back();
  const turbomap::span<const posed> neighbours(resident.data(), neighbour_count),
      plain_neighbours(plain.data(), neighbour_count);

  turbomap::correspondences<orb, fisheye, Policy> matches(ctx);
  typename turbomap::correspondences<orb, fisheye, Policy>::plan_type plan;
  const auto search = [&](turbomap::candidates set) {
    turbomap::search_options options;
    options.scales = recording.meta.pyramid();
    options.candidate_set = set;
    return options;
  };
  nlohmann::json stages;

  // The floor of an insertion: the bytes of the keyframe, written once.
  const auto data = turbomap_replay::recorded_keyframe(recording, last, rig, keypoints);
  std::vector<std::byte> from(static_cast<std::size_t>(store.statistics().bytes_per_keyframe)), to(from.size());
  std::vector<double> copies;
  for (int k = 0; k < 31; ++k) {
    const double begin = now_ms();
    std::copy(from.begin(), from.end(), to.begin());
    from[0] = to.back();
    copies.push_back(now_ms() - begin);
  }
  stages["insertion"] = interleave(
      repetitions, [&] { store.erase(store.insert(data)); }, [&] { host_store.erase(host_store.insert(data)); },
      median(copies));

  double in_words = 0, consistent = 0;
  count_pairs(plain_query, plain_neighbours, search(turbomap::candidates::exhaustive), in_words, consistent);
  const auto time_search = [&](const char* name, turbomap::candidates set, double pairs) {
    const auto options = search(set);
    stages[name] = interleave(
        repetitions,
        [&] {
          turbomap::search_correspondences(ctx, query, neighbours, options, matches);
          matches.plan(ctx, plan);
        },
        [&] { turbomap_test::search_oracle(plain_query, plain_neighbours, options); },
        distance_floor_ms(host_pinned[0], pairs));
  };
  time_search("search_grouped", turbomap::candidates::grouped, in_words);
  time_search("search_exhaustive", turbomap::candidates::exhaustive, consistent);
  time_search("search_exact", turbomap::candidates::epipolar_ordered, consistent);

  turbomap::point_creation<Policy> creation(ctx);
  std::vector<turbomap::created_point> points;
  turbomap::creation_options options;
  options.scales = recording.meta.pyramid();
  const auto oracle_matches =
      turbomap_test::search_oracle(plain_query, plain_neighbours, search(turbomap::candidates::exhaustive));
  stages["creation"] = interleave(
      repetitions,
      [&] {
        turbomap::create_points(ctx, matches, options, creation);
        creation.plan(ctx, matches, points);
      },
      [&] { turbomap_test::creation_oracle(plain_query, plain_neighbours, oracle_matches, options); }, 0);
  stages["creation"].erase("floor_ms");
  const double distance_ms = distance_floor_ms(host_pinned[0], 1);
  run_map_stages(ctx, recording, repetitions, distance_ms, stages);
  return stages;
}

}  // namespace turbomap_bench
