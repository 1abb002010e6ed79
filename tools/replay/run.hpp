// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-replay under one policy: reads, checks or replays, prints, and writes what it is asked for.

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <type_traits>

#include <turbomap/io/ply.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/io/trajectory.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

#include "check.hpp"
#include "growth.hpp"
#include "keypoint_offset.hpp"
#include "loop.hpp"
#include "make_report.hpp"
#include "print_outcome.hpp"
#include "replay_json.hpp"
#include "replay_on.hpp"
#include "simulation/random.hpp"
#include "trajectory_errors.hpp"

namespace turbomap_replay {

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

/// The body of each keyframe that is left, in the world.
inline void write_trajectory(const std::filesystem::path& file, const turbomap::recording& recording,
                             const replay_result& result) {
  std::vector<turbomap::stamped_pose> poses;
  const auto T_bc = turbomap::cast<double>(recording.meta.T_bc);
  for (std::size_t i = 0; i < result.T_cw.size(); ++i)
    if (result.alive[i] != 0)                                      // body in world: (T_bc T_cw)^-1
      if (poses.empty() || poses.back().t_ns < recording.t_ns[i])  // the format has one pose at a time
        poses.push_back({recording.t_ns[i], invert(compose(T_bc, result.T_cw[i]))});
  turbomap::write_trajectory(file, poses);
}

/// The points of the map, and the centres of the keyframes that are left.
inline void write_ply(const std::filesystem::path& file, const replay_result& result) {
  std::vector<turbomap::vec3<double>> centres;
  for (std::size_t i = 0; i < result.T_cw.size(); ++i)
    if (result.alive[i] != 0) centres.push_back(turbomap::camera_centre(turbomap::to_isometry<double>(result.T_cw[i])));
  turbomap::write_ply(file, result.points, centres);
}

/// Replays, prints, and writes the files that are asked for, but for the JSON.
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
  o.good = result.faults == 0;
  o.json = replay_json(recording, arguments, result, rows);
  for (const auto& s : stages) o.json["stages"][s.name] = s.json();
  if (!offset.is_null()) o.json["keypoint_offset"] = offset;
  if (!result.global.ms.empty()) {
    add_global_adjustment(result.global, o.json);
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
    add_search_checks(result.matches, recording.is_simulated(), o.json);
    o.good = o.good && result.matches.grouped_queries_lost == 0 && result.matches.ordered_equals_exhaustive;
  }
  if (!arguments.trajectory.empty()) write_trajectory(arguments.trajectory, recording, result);
  if (!arguments.ply.empty()) write_ply(arguments.ply, result);
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
