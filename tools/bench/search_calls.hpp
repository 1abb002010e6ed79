// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Single calls of the correspondence search, timed by themselves as their size grows: the last keyframe of a simulated recording against
/// up to ten before it, each with so many of its keypoints, a tenth of which have a point; and against one with 100,000 keypoints
/// each, as no extractor makes, but a lying file may. That results are right is tested elsewhere; what another policy takes is
/// the next run of the program.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "measure.hpp"
#include "replay/recorded_keyframes.hpp"

namespace turbomap_bench {

constexpr std::size_t crowd = 10000;  ///< no keyframe of the recording has so many keypoints

/// Adds keyframe i with about `keep` of its keypoints, at equal steps through the list. Where it has fewer, they come again,
/// some pixels aside and with other bits, until there are so many.
template <class Camera, class Store>
turbomap::keyframe_handle insert_thinned(Store& store, const turbomap::recording& recording, std::size_t i,
                                         const std::vector<turbomap::rig_camera<Camera>>& rig, std::size_t keep) {
  std::vector<turbomap::keypoint> all;
  auto data = turbomap_replay::recorded_keyframe(recording, i, rig, all);
  const auto descriptors = recording.descriptors(i);
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::decay_t<decltype(*descriptors.data())>> kept;
  const bool crowded = keep > crowd && !all.empty();
  const std::size_t count = crowded ? keep : std::min(keep, all.size());
  std::mt19937 random(static_cast<std::uint32_t>(i));
  const auto aside = [&] { return static_cast<float>(random() % 2001) / 50 - 20; };  // within 20 px
  for (std::size_t k = 0; k < count; ++k) {
    keypoints.push_back(all[k * all.size() / count]);
    kept.push_back(descriptors.data()[k * all.size() / count]);
    if (!crowded) continue;
    keypoints.back().x += aside(), keypoints.back().y += aside();
    for (auto& element : kept.back()) element ^= static_cast<std::uint8_t>(random() & random() & random());
  }
  data.keypoint_count = static_cast<int>(count), data.keypoints = keypoints.data();
  data.descriptors = kept.empty() ? nullptr : kept.data()->data();
  return store.insert(data);
}

template <class Camera, class Policy>
nlohmann::json run_search_calls(const Policy& policy, const turbomap::recording& recording, int repetitions) {
  turbomap::context<Policy> ctx(policy);
  const auto rig = turbomap_replay::recorded_rig<Camera>(recording.meta);
  const std::size_t last = recording.keyframe_count() - 1, before = std::min<std::size_t>(last, 10);
  turbomap::search_options options;
  options.scales = recording.meta.pyramid();
  turbomap::correspondences<orb, Camera, Policy> found(ctx);
  typename turbomap::correspondences<orb, Camera, Policy>::plan_type plan;
  nlohmann::json stages;
  for (const std::size_t keypoints : {25U, 100U, 200U, 800U, 1500U, 3000U, 100000U}) {
    const std::size_t first = last - (keypoints > crowd ? std::min<std::size_t>(before, 1) : before);
    const int repeat = keypoints > crowd ? std::min(repetitions, 3) : repetitions;
    turbomap::keyframe_store<orb, Camera, turbomap::memory_of_t<Policy>> store(
        turbomap_replay::recorded_store_options(recording.meta));
    std::vector<turbomap::keyframe_handle> handles;
    for (std::size_t i = first; i <= last; ++i) handles.push_back(insert_thinned(store, recording, i, rig, keypoints));
    const auto pinned = store.pin(ctx, handles);
    std::vector<std::uint8_t> has_point(keypoints, 0);
    for (std::size_t k = 0; k < keypoints; k += 10) has_point[k] = 1;
    std::vector<turbomap::posed_keyframe<orb, Camera>> posed;
    for (std::size_t i = first; i <= last; ++i) {
      const auto view = pinned[i - first];
      posed.push_back({view,
                       turbomap::cast<double>(recording.T_cw[i]),
                       {has_point.data(), static_cast<std::size_t>(view.keypoint_count)}});
    }
    const turbomap::span<const turbomap::posed_keyframe<orb, Camera>> neighbours(posed.data(), posed.size() - 1);
    const auto call = [&] {
      turbomap::search_correspondences(ctx, posed.back(), neighbours, options, found);
      ctx.synchronize();
    };
    const auto with_plan = [&] {
      turbomap::search_correspondences(ctx, posed.back(), neighbours, options, found);
      found.plan(ctx, plan);
    };
    const std::string size = std::to_string(keypoints);
    stages["search_" + size] = interleave(repeat, call, {}, 0);
    stages["search_plan_" + size] = interleave(repeat, with_plan, {}, 0);
    stages["search_plan_" + size]["matches"] = plan.size();
  }
  return stages;
}

}  // namespace turbomap_bench
