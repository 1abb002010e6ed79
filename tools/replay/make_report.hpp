// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// From the result of a replay to the data of its report.

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/io/timing_table.hpp>

#include "bench/machine.hpp"
#include "loop.hpp"
#include "report.hpp"
#include "report_paths.hpp"
#include "stage_times.hpp"

namespace turbomap_replay {

inline report_row make_report_row(const turbomap::recording& recording, const std::vector<stage_samples>& stages,
                                  const turbomap::timing_table& timing, const replay_row& from, std::size_t i) {
  const auto& r = from.report;
  report_row row;
  row.time_s = 1e-9 * static_cast<double>(recording.t_ns[i] - recording.t_ns[0]);
  row.total_ms = from.total_ms;
  row.points = static_cast<std::int64_t>(from.points);
  row.keyframes = static_cast<std::int64_t>(from.keyframes);
  row.observations = static_cast<std::int64_t>(from.observations);
  row.points_created = static_cast<std::int64_t>(r.points_created);
  row.points_culled = static_cast<std::int64_t>(r.points_culled);
  row.merged = static_cast<std::int64_t>(r.fused.merged);
  row.observations_added = static_cast<std::int64_t>(r.fused.observations_added);
  row.keyframes_culled = static_cast<std::int64_t>(r.keyframes_culled.size());
  const auto peer = [&](const char* column) { return timing.has(column) ? timing.column(column)[i] : not_known; };
  for (std::size_t k = 0; k < turbomap::mapping_stages; ++k) {
    const auto stage = static_cast<turbomap::mapping_stage>(k);
    const bool shown = std::any_of(stages.begin(), stages.end(),
                                   [&](const stage_samples& s) { return s.name == turbomap::to_string(stage); });
    if (!shown) continue;
    const auto outcome = r.outcome[stage];
    row.stage_ms.push_back(from.ran(stage) ? from.ms(stage) : not_known);
    row.peer_stage_ms.push_back(i < timing.row_count() ? peer_ms(stage, peer) : not_known);
    row.skipped.push_back(outcome == turbomap::stage_outcome::skipped ? 1 : 0);
    row.cut.push_back(outcome == turbomap::stage_outcome::cut ? 1 : 0);
  }
  return row;
}

inline report_data make_report(const turbomap::recording& recording, const arguments& arguments,
                               const replay_result& result, const std::vector<stage_samples>& stages,
                               const turbomap::timing_table& timing, const nlohmann::json& json) {
  report_data data;
  data.recording = arguments.recording.string();
  data.policy = arguments.policy;
  data.machine = turbomap_bench::processor_name();
  data.peer = recording.is_simulated() ? "peer" : "recorded system";
  data.keyframes = json["keyframes"], data.keyframes_left = json["keyframes_left"];
  data.map_points = json["map_points"], data.skipped = json["skipped"];
  if (json.contains("ate_rmse_m")) data.ate_rmse_m = json["ate_rmse_m"];
  if (json.contains("peer_ate_rmse_m")) data.peer_ate_rmse_m = json["peer_ate_rmse_m"];
  const auto add_error = [&](const char* name, const char* key) {
    char text[32];
    if (!json.contains(key) || !std::isfinite(json[key].get<double>())) return;
    std::snprintf(text, sizeof text, "%.4f m", json[key].get<double>());
    data.facts.emplace_back(name, text);
  };
  add_error("ATE of the poses that came in", "ate_input_rmse_m");
  add_error("ATE of one adjustment of all true observations", "ate_batch_rmse_m");
  for (const stage_samples& s : stages) {
    report_stage stage{s.name};
    if (s.ms.count() != 0)
      stage = {s.name,           s.mean(),      s.quantile(0.5),
               s.quantile(0.95), s.quantile(1), s.peer_ms_mean >= 0 ? s.peer_ms_mean : not_known};
    if (s.name == "total")
      data.total = stage;
    else
      data.stages.push_back(stage);
  }
  data.warm_up = std::min(warm_up, result.rows.size());
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    data.rows.push_back(make_report_row(recording, stages, timing, result.rows[i], i));
    data.trajectory.push_back(
        {turbomap::camera_centre(turbomap::to_isometry<double>(result.T_cw[i])), result.alive[i] != 0});
  }
  for (const auto& event : recording.meta.events)
    if (event.iteration >= 0 && static_cast<std::size_t>(event.iteration) < result.rows.size())
      data.events.push_back({static_cast<std::size_t>(event.iteration), event.name});
  data.points = result.points;
  data.point_observations = result.point_observations;
  add_recorded_paths(recording, data);
  return data;
}

}  // namespace turbomap_replay
