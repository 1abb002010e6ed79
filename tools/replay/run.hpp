// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-replay under one policy: reads, checks or replays, prints, and makes the JSON of the contract.

#include <cmath>
#include <cstdio>
#include <numeric>
#include <stdexcept>
#include <type_traits>

#include <turbomap/io/ply.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/io/trajectory.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include "bench/machine.hpp"
#include "check.hpp"
#include "growth.hpp"
#include "keypoint_offset.hpp"
#include "loop.hpp"
#include "make_report.hpp"
#include "print_outcome.hpp"
#include "replay_on.hpp"
#include "simulation/random.hpp"
#include "trajectory_errors.hpp"

namespace turbomap_replay {

/// The stages of some replays, 'process' with the insertion and the total last, beside the peer's means.
inline std::vector<stage_samples> stages_of(const std::vector<replay_row>& rows, const turbomap::timing_table& timing) {
  std::vector<stage_samples> stages;
  const auto peer = [&](const char* column) { return timing.has(column) ? timing.mean(column) : std::nan(""); };
  const double peer_search = peer("ms_sft");
  const double peer_ms[turbomap::mapping_stages] = {
      peer("ms_process"), peer("ms_mpculling"), peer_search,         peer("ms_createnew") - peer_search,
      peer("ms_fuse"),    peer("ms_lba"),       peer("ms_cull_orig")};
  stage_samples total{"total", -1, {}};
  double peer_total = 0;
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
    const auto stage = static_cast<turbomap::mapping_stage>(s);
    stage_samples samples{turbomap::to_string(stage), std::isfinite(peer_ms[s]) ? peer_ms[s] : -1, {}};
    for (const replay_row& row : rows)
      if (row.report.outcome[stage] == turbomap::stage_outcome::done ||
          row.report.outcome[stage] == turbomap::stage_outcome::cut)
        samples.ms.add(row.report.ms[stage] + (stage == turbomap::mapping_stage::process ? row.insertion_ms : 0));
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

/// A map of the recording's first keyframes, and what its observations say of how they were extracted. Visual: alpha needs
/// no gravity. No keyframe is culled, so that points have more views.
template <class Camera, class Policy>
keypoint_offset keypoint_offset_of(const turbomap::recording& recording, const Policy& policy, const arguments& of) {
  const keypoint_offset_options options;
  arguments plain;
  plain.policy = of.policy, plain.culling = false, plain.quiet = true, plain.gather_observations = true;
  plain.imu = plain.pixel_centres = choice::no;
  plain.most_keyframes = options.keyframes, plain.work = "look at how keypoints were extracted";
  const auto r = replayer<turbomap::simple_map<orb, Camera>, Policy>(recording, policy, plain).run();
  return estimate_keypoint_offset<Camera>(recording, policy, r.observations, r.T_cw, r.alive,
                                          plain.correlation(recording), options);
}

/// What the recording decides where the arguments do not: its IMU, and how its keypoints were extracted.
template <class Camera, class Policy>
arguments decided(const turbomap::recording& recording, const Policy& policy, arguments a, nlohmann::json& json) {
  if (a.imu == choice::by_recording)
    a.imu = recording.meta.sensor == "inertial" && recording.has_imu() ? choice::yes : choice::no;
  a.gather_observations = a.error_parts && !a.quiet;
  if (a.imu == choice::no && a.imu_noise != 1) throw std::invalid_argument("--imu-noise: the replay is without an IMU");
  if (a.imu == choice::no && a.marginal_prior)
    throw std::invalid_argument("--marginal-prior: the replay is without an IMU");
  const std::string& from = recording.meta.keypoint_pixels;
  if (a.pixel_centres == choice::by_recording && from == "unknown" && !recording.is_simulated()) {
    const keypoint_offset found = keypoint_offset_of<Camera>(recording, policy, a);
    a.pixel_centres = found.multiplied ? choice::yes : choice::no;
    json = found.json();
  }
  if (a.pixel_centres == choice::by_recording) a.pixel_centres = from == "multiplied" ? choice::yes : choice::no;
  return a;
}

/// On the map that the arguments name, with the IMU or without. A map of objects is for host policies.
template <class Camera, class Policy>
replay_result replay_once(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  const bool with_imu = arguments.imu == choice::yes;
  if constexpr (std::is_same_v<Policy, turbomap_program::host_policy>)
    if (arguments.objects) {
      using turbomap_program::inertial_objects_map;
      using turbomap_program::objects_map;
      return with_imu ? replay_on<inertial_objects_map<Camera>, recorded_imu>(recording, policy, arguments)
                      : replay_on<objects_map<Camera>, no_imu>(recording, policy, arguments);
    }
  return with_imu ? replay_on<turbomap::simple_inertial_map<orb, Camera>, recorded_imu>(recording, policy, arguments)
                  : replayer<turbomap::simple_map<orb, Camera>, Policy>(recording, policy, arguments).run();
}

template <class Camera, class Policy>
outcome replay(const turbomap::recording& recording, const Policy& policy, const arguments& given) {
  // Read first: what is wrong with it shows at once. A simulated recording may have been written over a recorded one, whose times
  // stay in the folder.
  const turbomap::timing_table timing =
      recording.is_simulated() ? turbomap::timing_table{} : turbomap::read_timing(given.recording);
  nlohmann::json offset;
  const arguments arguments = decided<Camera>(recording, policy, given, offset);
  if (!arguments.without_imu.empty() && !arguments.quiet && recording.meta.sensor == "inertial" && recording.has_imu())
    std::printf("replayed without its IMU: %s\n", arguments.without_imu.c_str());
  replay_result result;
  std::vector<replay_row> rows;  // of all repetitions, the first keyframes left out
  outcome o;
  o.begin_ms = now_ms();
  for (int k = 0; k < arguments.repeat; ++k) {
    result = replay_once<Camera>(recording, policy, arguments);
    for (std::size_t i = warm_up; i < result.rows.size(); ++i) rows.push_back(result.rows[i]);
  }
  o.end_ms = now_ms();
  const std::vector<stage_samples> stages = stages_of(rows, timing);
  std::size_t skipped = 0, cut = 0, keyframes_culled = 0, points_culled = 0, created = 0, matches = 0;
  std::size_t adjustments = 0, adjustment_iterations = 0;
  turbomap::fusion_summary fused;
  turbomap::creation_summary creation;
  turbomap::per_stage<std::vector<std::size_t>> skipped_at;  // keyframes
  for (std::size_t k = 0; k < result.rows.size(); ++k) {
    const replay_row& row = result.rows[k];
    bool any = false;
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      const bool skip = row.report.outcome.values[s] == turbomap::stage_outcome::skipped;
      if (skip) skipped_at.values[s].push_back(k);
      any = any || skip;
    }
    skipped += any ? 1 : 0;
    cut += row.report.cut ? 1 : 0;
    keyframes_culled += row.report.keyframes_culled.size();
    points_culled += row.report.points_culled;
    created += row.report.points_created;
    matches += row.report.matches, creation.tracks += row.report.creation.tracks;
    creation.contradictions += row.report.creation.contradictions;
    creation.known += row.report.creation.known;
    creation.views_left_out += row.report.creation.views_left_out;
    fused += row.report.fused;
    const std::size_t iterations = static_cast<std::size_t>(row.report.adjustment.solve.iterations);
    adjustments += iterations > 0 ? 1 : 0, adjustment_iterations += iterations;
  }
  o.good = result.faults == 0;
  o.json = {{"recording", arguments.recording.string()},
            {"policy", arguments.policy},
            {"compiled", turbomap_bench::compiled()},
            {"map", arguments.objects ? "objects" : "simple"},
            {"keyframes", recording.keyframe_count()},
            {"keyframes_left", result.keyframes_left},
            {"map_points", result.points.size()},
            {"skipped", skipped},
            {"cut", cut},
            {"map_faults", result.faults},
            {"map_digest", result.map_digest},
            {"points_created", created},
            {"matches", matches},
            {"tracks", creation.tracks},
            {"contradictions", creation.contradictions},
            {"tracks_known", creation.known},
            {"views_left_out", creation.views_left_out},
            {"points_culled", points_culled},
            {"keyframes_culled", keyframes_culled},
            {"adjustments", adjustments},
            {"adjustment_iterations", adjustment_iterations},
            {"duplicates_merged", fused.merged},
            {"observations_added", fused.observations_added},
            {"fusion_conflicts", fused.conflicts},
            {"associations", result.associations},
            {"associations_kept", result.associations_kept},
            {"associate", arguments.projected ? "projected" : "recorded"},
            {"associations_projected", result.projected},
            {"associations_projected_kept", result.projected_kept},
            {"tracking_edits_ms_mean", tracking_edits_ms(rows)},
            {"guard_held", guard_json(rows)},
            {"peak_device_bytes", arguments.policy == "cuda" ? result.store.peak_chunk_bytes : 0},
            {"store_bytes_per_keyframe", result.store.bytes_per_keyframe}};
  for (const auto& s : stages) o.json["stages"][s.name] = s.json();
  if (arguments.imu == choice::yes) o.json["imu"] = result.imu;
  o.json["pixel_centres"] = arguments.pixel_centres == choice::yes;
  if (!offset.is_null()) o.json["keypoint_offset"] = offset;
  if (arguments.queue) {
    stage_samples latency{"latency", -1, {}};
    for (const replay_row& row : rows) latency.ms.add(row.latency_ms);
    o.json["rate"] = arguments.rate, o.json["latency"] = latency.json();
  }
  if (skipped != 0)
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) {
      const char* const stage = turbomap::to_string(static_cast<turbomap::mapping_stage>(s));
      o.json["skipped_stages"][stage] = skipped_at.values[s].size();
      o.json["skipped_at"][stage] = skipped_at.values[s];
    }
  if (!result.points.empty())
    o.json["observations_per_point"] =
        static_cast<double>(std::accumulate(result.point_observations.begin(), result.point_observations.end(), 0LL)) /
        static_cast<double>(result.points.size());
  if (recording.is_simulated()) {
    o.json["true_matches"] = {{"pairs", result.matches.matches}, {"correct", result.matches.correct_matches}};
    o.json["true_points"] = result.true_points.json();
    o.json["associations_projected_right"] = result.projected_right;
    o.json["associations_projected_kept_right"] = result.projected_kept_right;
  }
  if (arguments.merge_causes) o.json["merge_causes"] = result.merges.json();
  if (!result.global.ms.empty()) {
    const auto& last = result.global.last;
    o.json["global_adjustment"] = {
        {"times", result.global.ms.size()},      {"ms_last", result.global.ms.back()},
        {"iterations", last.solve.iterations},   {"end", turbomap::to_string(last.solve.end)},
        {"free_keyframes", last.free_keyframes}, {"points", last.points},
        {"observations", last.observations},     {"outliers", last.outliers},
        {"merged", result.global.fused.merged},  {"observations_added", result.global.fused.observations_added}};
    for (const auto& [call, held] :
         {std::pair("adjust_globally", result.global.adjusting), std::pair("fuse_around", result.global.fusing)})
      if (held.count != 0) o.json["guard_held"][call] = to_json(held);
    if (!arguments.quiet && arguments.global_end && recording.has_ground_truth())
      o.json["ate_before_global_rmse_m"] = trajectory_error(recording, result.global.T_cw_before, result.alive);
  }
  if (!arguments.quiet) {
    add_trajectory_errors<Camera>(recording, policy, result.T_cw, result.alive, o.json, arguments.bound);
    if (arguments.error_parts)
      o.json["error_parts"] =
          error_parts<Camera, Policy>(recording, policy, result.observations, result.T_cw, result.alive)();
    print_outcome(o.json, stages);
  }
  if (arguments.growth) {
    const auto columns = growth_columns(result.rows);
    o.json["growth"] = print_growth(columns);
    if (!arguments.growth_file.empty()) write_growth(arguments.growth_file, columns);
  }
  if (arguments.check) {  // a recording without snapshots: properties that need no recorded truth
    o.json["exhaustive"] = {{"pairs", result.matches.pairs},
                            {"grouped_queries_lost", result.matches.grouped_queries_lost},
                            {"ordered_equals_exhaustive", result.matches.ordered_equals_exhaustive}};
    if (recording.is_simulated())
      o.json["true_matches"]["grouped"] = {{"pairs", result.matches.grouped_pairs},
                                           {"correct", result.matches.grouped_correct}};
    o.good = o.good && result.matches.grouped_queries_lost == 0 && result.matches.ordered_equals_exhaustive;
  }
  if (!arguments.trajectory.empty()) {
    std::vector<turbomap::stamped_pose> poses;
    const auto T_bc = turbomap::cast<double>(recording.meta.T_bc);
    for (std::size_t i = 0; i < result.T_cw.size(); ++i)
      if (result.alive[i] != 0)                                      // body in world: (T_bc T_cw)^-1
        if (poses.empty() || poses.back().t_ns < recording.t_ns[i])  // the format has one pose at a time
          poses.push_back({recording.t_ns[i], invert(compose(T_bc, result.T_cw[i]))});
    turbomap::write_trajectory(arguments.trajectory, poses);
  }
  if (!arguments.ply.empty()) {
    std::vector<turbomap::vec3<double>> centres;
    for (std::size_t i = 0; i < result.T_cw.size(); ++i)
      if (result.alive[i] != 0)
        centres.push_back(turbomap::camera_centre(turbomap::to_isometry<double>(result.T_cw[i])));
    turbomap::write_ply(arguments.ply, result.points, centres);
  }
  if (!arguments.report.empty()) {
    write_report(arguments.report, make_report(recording, arguments, result, stages, timing, o.json));
    std::printf("report: %s\n", arguments.report.string().c_str());
  }
  return o;
}

template <class Camera, class Policy>
outcome run_with(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  if (!arguments.check || recording.meta.snapshots.empty()) return replay<Camera>(recording, policy, arguments);
  const std::vector<std::pair<const char*, bool>> of_replays{
      {"--report", !arguments.report.empty()},
      {"--ply", !arguments.ply.empty()},
      {"--trajectory", !arguments.trajectory.empty()},
      {"--growth", arguments.growth},
      {"--global-adjustment", arguments.global_end || arguments.global_every != 0},
      {"--merge-causes", arguments.merge_causes},
      {"--queue", arguments.queue},
      {"--behind", arguments.behind != 0}};
  refuse(of_replays, "--check of recorded snapshots");
  checker<Camera, Policy> check(recording, policy, arguments);
  for (const std::int32_t iteration : recording.meta.snapshots)
    check.check(turbomap::read_snapshot(recording, arguments.recording, iteration));
  return check.result();
}

/// Moves the poses that come in by a micrometre at random: two results that differ by no more than that makes each differ are
/// equally good.
inline void perturb(turbomap::recording& recording, std::uint64_t seed) {
  namespace sim = turbomap::simulation;
  sim::random_stream random(seed, sim::purpose::perturbation);
  for (auto& T : recording.T_cw)
    for (float* x : {&T.tx, &T.ty, &T.tz}) *x += static_cast<float>(1e-6 * random.normal());
}

/// The distortion of the right camera as a calibration tells it. A recording has what the recorded system used.
inline void set_right_distortion(turbomap::recording_meta& meta, const std::vector<double>& k) {
  if (!meta.is_fisheye() || meta.camera2.size() != 4 + k.size())
    throw std::invalid_argument("--right-distortion: the recording has no second fisheye camera");
  for (std::size_t i = 0; i < k.size(); ++i) {
    if (!std::isfinite(k[i]))
      throw std::invalid_argument("--right-distortion: k" + std::to_string(i + 1) + " = " + std::to_string(k[i]) +
                                  " must be finite");
    meta.camera2[4 + i] = k[i];
  }
}

/// Throws bad_file for a recording that cannot be read, std::invalid_argument for an option that is not for one of its kind.
template <class Policy>
outcome run(const Policy& policy, const arguments& arguments) {
  turbomap::recording recording = turbomap::read_recording(arguments.recording);
  if (arguments.error_parts && !recording.is_simulated())
    throw std::invalid_argument("--error-parts: the recording is not a simulated one");
  if (arguments.pixel_centres == choice::yes &&
      (recording.is_simulated() || recording.meta.keypoint_pixels == "full_image"))
    throw std::invalid_argument("--pixel-centres: keypoints of this recording are those of the full image");
  if (!arguments.right_distortion.empty()) set_right_distortion(recording.meta, arguments.right_distortion);
  if (arguments.perturb > 0) perturb(recording, static_cast<std::uint64_t>(arguments.perturb));
  return recording.meta.is_fisheye() ? run_with<turbomap::kannala_brandt<float>>(recording, policy, arguments)
                                     : run_with<turbomap::pinhole<float>>(recording, policy, arguments);
}

}  // namespace turbomap_replay
