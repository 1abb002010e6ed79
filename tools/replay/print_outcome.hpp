// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What turbomap-replay prints of a replay's JSON: of one, and of two policies side by side.

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "stage_times.hpp"

namespace turbomap_replay {

/// Prints what add_trajectory_errors() adds.
inline void print_trajectory_errors(const nlohmann::json& json) {
  if (!json.contains("ate_rmse_m")) return;
  const double ate = json["ate_rmse_m"];
  const auto covered = json["ate_keyframes"].get<std::size_t>(), left = json["keyframes_left"].get<std::size_t>();
  if (!std::isfinite(ate)) {
    std::printf("ATE not known: ground truth says where %zu of %zu keyframes were, three are needed\n", covered, left);
    return;
  }
  std::printf("ATE %.4f m", ate);
  if (covered != left) std::printf(" of the %zu keyframes whose time ground truth covers", covered);
  if (json.contains("peer_ate_rmse_m"))
    std::printf(" (peer, after its adjustment: %.4f m)", json["peer_ate_rmse_m"].get<double>());
  if (json.contains("ate_before_global_rmse_m"))
    std::printf("\n  before the adjustment of the whole map: %.4f m", json["ate_before_global_rmse_m"].get<double>());
  std::printf("\n  of the poses that came in: %.4f m\n", json["ate_input_rmse_m"].get<double>());
  if (json.contains("scale_error")) {
    std::printf("  scale off by %.2f %%; between events, each aligned by itself:",
                100 * json["scale_error"].get<double>());
    for (const auto& e : json["ate_intervals_m"]) std::printf(" %.4f", e.is_number() ? e.get<double>() : -1.0);
    std::printf(" m\n");
  }
  if (!json.contains("ate_batch_rmse_m")) return;
  const double bound = json["ate_batch_rmse_m"];
  std::printf(
      "  of one adjustment of all true observations, the best that they allow: %.4f m (the map's is %.1f times it)\n",
      bound, ate / bound);
}

inline void print_outcome(const nlohmann::json& json, const std::vector<stage_samples>& stages) {
  const auto count = [&](const char* key) { return json[key].get<std::size_t>(); };
  std::printf("%s: %zu keyframes, %zu left, policy %s, %zu map points\n", json["recording"].get<std::string>().c_str(),
              count("keyframes"), count("keyframes_left"), json["policy"].get<std::string>().c_str(),
              count("map_points"));
  std::printf(
      "%zu points created, %zu dropped on probation, %zu duplicates merged, %zu observations added, %zu keyframes "
      "culled\n",
      count("points_created"), count("points_culled"), count("duplicates_merged"), count("observations_added"),
      count("keyframes_culled"));
  if (count("adjustments") != 0)
    std::printf("%zu adjustments of %.2f iterations\n", count("adjustments"),
                static_cast<double>(count("adjustment_iterations")) / static_cast<double>(count("adjustments")));
  if (count("skipped") != 0 || count("cut") != 0)
    std::printf("%zu keyframes with stages skipped because more waited, %zu cut by the deadline\n", count("skipped"),
                count("cut"));
  if (json["associate"] == "projected")
    std::printf("%zu associations by projection of the local map, %zu of them kept\n", count("associations_projected"),
                count("associations_projected_kept"));
  if (json.contains("keypoint_offset")) {
    const auto& o = json["keypoint_offset"];
    const double alpha = o["alpha"], sigma = o["sigma"];
    std::printf("keypoints of coarser levels are off by %.2f +- %.2f of half a pixel: %s\n", alpha, sigma,
                o["multiplied"].get<bool>() ? "moved to the full image" : "left as recorded");
  }
  if (json.contains("imu")) {
    const auto& events = json["imu"]["events"];
    if (events.empty()) std::printf("IMU not initialised\n");
    if (!events.empty()) std::printf("IMU initialised after %.1f s\n", events[0]["seconds"].get<double>());
  }
  print_table(stages);
  if (count("map_faults") != 0) std::printf("%zu faults in the map\n", count("map_faults"));
  if (json.contains("true_matches"))
    std::printf("%zu matches, %zu of them right by the simulator's ids\n",
                json["true_matches"]["pairs"].get<std::size_t>(), json["true_matches"]["correct"].get<std::size_t>());
  if (json.contains("true_points")) {
    const auto& t = json["true_points"];
    const auto of = [&](const char* key) { return t[key].get<std::size_t>(); };
    std::printf("wrong by the simulator's ids: %zu of %zu points created, %zu of %zu merges, %zu of %zu points left\n",
                of("created_wrong"), of("created"), of("merged_wrong"), of("merged"), of("points_wrong"), of("points"));
  }
  std::printf("store %.0f bytes per keyframe\n", json["store_bytes_per_keyframe"].get<double>());
  print_trajectory_errors(json);
}

/// Mean times of replays of one recording under several policies, and whether their maps are those of the first.
inline void print_beside(const std::vector<nlohmann::json>& replays) {
  std::printf("\n%-16s", "ms per keyframe");
  for (const auto& replay : replays) std::printf(" %10s", replay["policy"].get<std::string>().c_str());
  std::printf("\n");
  for (const char* stage :
       {"process", "point_culling", "search", "creation", "fusion", "adjustment", "keyframe_culling", "total"}) {
    if (!replays[0]["stages"].contains(stage)) continue;
    std::printf("%-16s", stage);
    for (const auto& replay : replays) {
      const auto& mean = replay["stages"][stage]["ms_mean"];
      mean.is_null() ? std::printf(" %10s", "-") : std::printf(" %10.3f", mean.get<double>());
    }
    std::printf("\n");
  }
  for (std::size_t i = 1; i < replays.size(); ++i) {
    const bool same = replays[i]["map_digest"] == replays[0]["map_digest"];
    std::printf("the map under %s: %s\n", replays[i]["policy"].get<std::string>().c_str(),
                same ? "the same, to the last bit" : "not the same to the last bit");
  }
}

}  // namespace turbomap_replay
