// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Single calls of the correspondence search, timed by themselves as their size grows: the last keyframe of a simulated recording against
/// up to ten before it, each with so many of its keypoints, a tenth of which have a point. That results are right is tested
/// elsewhere; what another policy takes is the next run of the program.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/store/keyframe_store.hpp>

#include "measure.hpp"
#include "replay/recorded_keyframes.hpp"

namespace turbomap_bench {

/// Adds keyframe i with about `keep` of its keypoints, at equal steps through the list.
template <class Camera, class Store>
turbomap::keyframe_handle insert_thinned(Store& store, const turbomap::recording& recording, std::size_t i,
                                         const std::vector<turbomap::rig_camera<Camera>>& rig, std::size_t keep) {
  std::vector<turbomap::keypoint> all;
  auto data = turbomap_replay::recorded_keyframe(recording, i, rig, all);
  const auto descriptors = recording.descriptors(i);
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::decay_t<decltype(*descriptors.data())>> kept;
  const std::size_t count = std::min(keep, all.size());
  for (std::size_t k = 0; k < count; ++k) {
    keypoints.push_back(all[k * all.size() / count]);
    kept.push_back(descriptors.data()[k * all.size() / count]);
  }
  data.keypoint_count = static_cast<int>(count), data.keypoints = keypoints.data();
  data.descriptors = kept.empty() ? nullptr : kept.data()->data();
  return store.insert(data);
}

template <class Camera, class Policy>
nlohmann::json run_search_calls(const Policy& policy, const turbomap::recording& recording, int repetitions) {
  turbomap::context<Policy> ctx(policy);
  const auto rig = turbomap_replay::recorded_rig<Camera>(recording.meta);
  const std::size_t last = recording.keyframe_count() - 1, first = last - std::min<std::size_t>(last, 10);
  turbomap::search_options options;
  options.scales = recording.meta.pyramid();
  turbomap::correspondences<orb, Camera, Policy> found(ctx);
  typename turbomap::correspondences<orb, Camera, Policy>::plan_type plan;
  nlohmann::json stages;
  for (const std::size_t keypoints : {25U, 100U, 200U, 800U, 1500U, 3000U}) {
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
    stages["search_" + size] = interleave(repetitions, call, {}, 0);
    stages["search_plan_" + size] = interleave(repetitions, with_plan, {}, 0);
    stages["search_plan_" + size]["matches"] = plan.size();
  }
  return stages;
}

}  // namespace turbomap_bench
