// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a replay as JSON: the keys that scripts rely on.

#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/io/timing_table.hpp>

#include "bench/machine.hpp"
#include "loop.hpp"
#include "stage_times.hpp"

namespace turbomap_replay {

/// The stages of some replays, 'process' with the insertion and the total last, beside the peer's means.
inline std::vector<stage_samples> stages_of(const std::vector<replay_row>& rows, const turbomap::timing_table& timing) {
  std::vector<stage_samples> stages;
  const auto mean = [&](const char* column) { return timing.has(column) ? timing.mean(column) : std::nan(""); };
  stage_samples total{"total", -1, {}};
  double peer_total = 0;
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
    const auto stage = static_cast<turbomap::mapping_stage>(s);
    const double peer = peer_ms(stage, mean);
    stage_samples samples{turbomap::to_string(stage), std::isfinite(peer) ? peer : -1, {}};
    for (const replay_row& row : rows)
      if (row.ran(stage)) samples.ms.add(row.ms(stage));
    if (samples.ms.count() == 0) continue;
    peer_total += samples.peer_ms_mean >= 0 ? samples.peer_ms_mean : std::nan("");
    stages.push_back(samples);
  }
  for (const replay_row& row : rows) total.ms.add(row.total_ms);
  total.peer_ms_mean = std::isfinite(peer_total) && total.ms.count() != 0 ? peer_total : -1;
  stages.push_back(total);
  return stages;
}

/// Mean time of what tracking itself writes to the map; NaN without keyframes.
inline double tracking_edits_ms(const std::vector<replay_row>& rows) {
  turbomap::duration_statistics ms;
  for (const replay_row& row : rows) ms.add(row.edits_ms);
  return ms.count() != 0 ? ms.mean() : std::nan("");
}

/// Mean, 99th percentile and longest time that the map's guard was held.
inline nlohmann::json to_json(const turbomap::guard_times& held) {
  return {{"times", held.count},
          {"ms_mean", held.total_ms / static_cast<double>(held.count)},
          {"ms_p99", held.quantile(0.99)},
          {"ms_max", held.longest_ms},
          {"over_1_ms", held.over_1_ms}};
}

/// The same by stage.
inline nlohmann::json guard_json(const std::vector<replay_row>& rows) {
  nlohmann::json json;
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
    const auto stage = static_cast<turbomap::mapping_stage>(s);
    turbomap::guard_times all;
    for (const replay_row& row : rows) all += row.report.held[stage];
    if (all.count == 0) continue;
    nlohmann::json& held = json[turbomap::to_string(stage)];
    held = to_json(all);
    // A search commits nothing; commits of stages that are not named here are not told apart.
    using turbomap::mapping_stage;
    if (stage == mapping_stage::search || stage == mapping_stage::creation || stage == mapping_stage::fusion)
      held["ms_commit"] = all.commit_ms;
  }
  return json;
}

/// Sums over the keyframes of a replay.
struct replay_totals {
  std::size_t skipped = 0, cut = 0, keyframes_culled = 0, points_culled = 0, created = 0, matches = 0;
  std::size_t adjustments = 0, adjustment_iterations = 0;
  turbomap::fusion_summary fused;
  turbomap::creation_summary creation;
  turbomap::per_stage<std::vector<std::size_t>> skipped_at;  ///< keyframes
};
inline replay_totals totals_of(const std::vector<replay_row>& rows) {
  replay_totals t;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const replay_row& row = rows[k];
    bool any = false;
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      const bool skip = row.report.outcome.values[s] == turbomap::stage_outcome::skipped;
      if (skip) t.skipped_at.values[s].push_back(k);
      any = any || skip;
    }
    t.skipped += any ? 1 : 0;
    t.cut += row.report.cut ? 1 : 0;
    t.keyframes_culled += row.report.keyframes_culled.size();
    t.points_culled += row.report.points_culled;
    t.created += row.report.points_created;
    t.matches += row.report.matches, t.creation.tracks += row.report.creation.tracks;
    t.creation.contradictions += row.report.creation.contradictions;
    t.creation.known += row.report.creation.known;
    t.creation.views_left_out += row.report.creation.views_left_out;
    t.fused += row.report.fused;
    const std::size_t iterations = static_cast<std::size_t>(row.report.adjustment.solve.iterations);
    t.adjustments += iterations > 0 ? 1 : 0, t.adjustment_iterations += iterations;
  }
  return t;
}

/// What the simulator's ids tell.
inline void add_truth(const replay_result& result, nlohmann::json& json) {
  json["true_matches"] = {{"pairs", result.matches.matches}, {"correct", result.matches.correct_matches}};
  json["true_points"] = result.true_points.json();
  json["associations_projected_right"] = result.projected_right;
  json["associations_projected_kept_right"] = result.projected_kept_right;
}

/// \param timed  of all repetitions, the keyframes whose times count
inline nlohmann::json replay_json(const turbomap::recording& recording, const arguments& arguments,
                                  const replay_result& result, const std::vector<replay_row>& timed) {
  const replay_totals t = totals_of(result.rows);
  nlohmann::json json = {{"recording", arguments.recording.string()},
                         {"policy", arguments.policy},
                         {"compiled", turbomap_bench::compiled()},
                         {"map", arguments.objects ? "objects" : "simple"},
                         {"keyframes", recording.keyframe_count()},
                         {"keyframes_left", result.keyframes_left},
                         {"map_points", result.points.size()},
                         {"skipped", t.skipped},
                         {"cut", t.cut},
                         {"map_faults", result.faults},
                         {"map_digest", result.map_digest},
                         {"points_created", t.created},
                         {"matches", t.matches},
                         {"tracks", t.creation.tracks},
                         {"contradictions", t.creation.contradictions},
                         {"tracks_known", t.creation.known},
                         {"views_left_out", t.creation.views_left_out},
                         {"points_culled", t.points_culled},
                         {"keyframes_culled", t.keyframes_culled},
                         {"adjustments", t.adjustments},
                         {"adjustment_iterations", t.adjustment_iterations},
                         {"duplicates_merged", t.fused.merged},
                         {"observations_added", t.fused.observations_added},
                         {"fusion_conflicts", t.fused.conflicts},
                         {"associations", result.associations},
                         {"associations_kept", result.associations_kept},
                         {"associate", arguments.projected ? "projected" : "recorded"},
                         {"associations_projected", result.projected},
                         {"associations_projected_kept", result.projected_kept},
                         {"tracking_edits_ms_mean", tracking_edits_ms(timed)},
                         {"guard_held", guard_json(timed)},
                         {"peak_device_bytes", arguments.policy == "cuda" ? result.store.peak_chunk_bytes : 0},
                         {"store_bytes_per_keyframe", result.store.bytes_per_keyframe}};
  if (arguments.imu == choice::yes) json["imu"] = result.imu;
  json["pixel_centres"] = arguments.pixel_centres == choice::yes;
  if (arguments.queue) {
    stage_samples latency{"latency", -1, {}};
    for (const replay_row& row : timed) latency.ms.add(row.latency_ms);
    json["rate"] = arguments.rate, json["latency"] = latency.json();
  }
  if (t.skipped != 0)
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      const char* const stage = turbomap::to_string(static_cast<turbomap::mapping_stage>(s));
      json["skipped_stages"][stage] = t.skipped_at.values[s].size();
      json["skipped_at"][stage] = t.skipped_at.values[s];
    }
  if (!result.points.empty())
    json["observations_per_point"] =
        static_cast<double>(std::accumulate(result.point_observations.begin(), result.point_observations.end(), 0LL)) /
        static_cast<double>(result.points.size());
  if (recording.is_simulated()) add_truth(result, json);
  if (arguments.merge_causes) json["merge_causes"] = result.merges.json();
  return json;
}

inline void add_global_adjustment(const global_result& global, nlohmann::json& json) {
  const auto& last = global.last;
  json["global_adjustment"] = {{"times", global.ms.size()},
                               {"ms_last", global.ms.back()},
                               {"iterations", last.solve.iterations},
                               {"end", turbomap::to_string(last.solve.end)},
                               {"free_keyframes", last.free_keyframes},
                               {"points", last.points},
                               {"observations", last.observations},
                               {"outliers", last.outliers},
                               {"merged", global.fused.merged},
                               {"observations_added", global.fused.observations_added}};
  for (const auto& [call, held] :
       {std::pair("adjust_globally", global.adjusting), std::pair("fuse_around", global.fusing)})
    if (held.count != 0) json["guard_held"][call] = to_json(held);
}

/// How the candidate sets of the search compare with the exhaustive one.
inline void add_search_checks(const match_verdict& matches, bool simulated, nlohmann::json& json) {
  json["exhaustive"] = {{"pairs", matches.pairs},
                        {"grouped_queries_lost", matches.grouped_queries_lost},
                        {"ordered_equals_exhaustive", matches.ordered_equals_exhaustive}};
  if (simulated)
    json["true_matches"]["grouped"] = {{"pairs", matches.grouped_pairs}, {"correct", matches.grouped_correct}};
}

}  // namespace turbomap_replay
