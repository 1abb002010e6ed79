// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// One run of turbomap-replay under one policy: reads, checks or replays, prints, and makes the JSON of the contract.

#include <cstdio>

#include <turbomap/io/recording.hpp>
#include <turbomap/io/trajectory.hpp>

#include "check.hpp"
#include "loop.hpp"

namespace turbomap_replay {

/// Peer's means of the stages that we have, from its recorded times.
inline void set_peer(const turbomap::timing_table& timing, replay_result& r) {
  if (timing.empty()) return;
  const double search = timing.mean("ms_sft"), creation = timing.mean("ms_createnew") - search;
  r.process.peer_ms_mean = timing.mean("ms_process");
  r.search.peer_ms_mean = search;
  r.creation.peer_ms_mean = creation;
  r.total.peer_ms_mean = r.process.peer_ms_mean + search + creation;
}

template <class Camera, class Policy>
outcome replay(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  replay_result result;
  for (int k = 0; k < arguments.repeat; ++k) {
    replay_result again = replayer<Camera, Policy>(recording, policy, arguments).run();
    const auto add = [](stage_samples& to, stage_samples& from) {
      from.ms.insert(from.ms.begin(), to.ms.begin(), to.ms.end());
    };
    add(result.process, again.process), add(result.search, again.search);
    add(result.creation, again.creation), add(result.total, again.total);
    result = std::move(again);
  }
  set_peer(turbomap::read_timing(arguments.recording), result);

  std::vector<stage_samples> stages{result.process};
  if (arguments.search) stages.push_back(result.search);
  if (arguments.search && arguments.creation) stages.push_back(result.creation);
  stages.push_back(result.total);
  std::printf("%s: %zu keyframes, policy %s, %zu map points\n", arguments.recording.string().c_str(),
              recording.keyframe_count(), arguments.policy.c_str(), result.map_points);
  print_table(stages);

  outcome o;
  o.json = {{"recording", arguments.recording.string()},
            {"policy", arguments.policy},
            {"keyframes", recording.keyframe_count()},
            {"keyframes_left", recording.keyframe_count()},
            {"map_points", result.map_points},
            {"skipped", 0},
            {"peak_device_bytes", arguments.policy == "cuda" ? result.store.peak_chunk_bytes : 0},
            {"store_bytes_per_keyframe", result.store.bytes_per_keyframe}};
  for (const auto& s : stages) o.json["stages"][s.name] = s.json();
  if (recording.has_ground_truth()) {
    std::vector<turbomap::rigid_transform<float>> T_cw;
    for (const auto& T : result.T_cw) T_cw.push_back(turbomap::cast<float>(T));
    const double ate = turbomap::keyframe_trajectory_error(recording, T_cw);
    o.json["ate_rmse_m"] = ate;
    std::printf("ATE %.4f m", ate);
    if (recording.meta.ate_kf_rmse_m >= 0) {
      o.json["peer_ate_rmse_m"] = recording.meta.ate_kf_rmse_m;
      std::printf(" (peer, after its adjustment: %.4f m)", recording.meta.ate_kf_rmse_m);
    }
    std::printf("; store %.0f bytes a keyframe\n", result.store.bytes_per_keyframe);
  }
  if (recording.is_simulated()) {
    o.json["true_matches"] = {{"pairs", result.matches}, {"correct", result.correct_matches}};
    std::printf("%zu matches, %zu of them right by the simulator's ids\n", result.matches, result.correct_matches);
  }
  if (arguments.check) {  // a recording without snapshots: properties that need no recorded truth
    o.json["exhaustive"] = {{"pairs", result.pairs},
                            {"grouped_queries_lost", result.grouped_queries_lost},
                            {"ordered_equals_exhaustive", result.ordered_equals_exhaustive}};
    if (recording.is_simulated())
      o.json["true_matches"]["grouped"] = {{"pairs", result.grouped_pairs}, {"correct", result.grouped_correct}};
    o.good = result.grouped_queries_lost == 0 && result.ordered_equals_exhaustive;
  }
  if (!arguments.trajectory.empty()) {
    std::vector<turbomap::stamped_pose> poses;
    const auto T_cb = turbomap::inverse(turbomap::to_isometry<double>(recording.meta.T_bc));
    for (std::size_t i = 0; i < result.T_cw.size(); ++i) {
      // Body in world: T_wb = T_wc T_cb. The quaternion of a product is the product of the quaternions.
      const auto& c = result.T_cw[i];
      const auto b = turbomap::cast<double>(recording.meta.T_bc);
      turbomap::stamped_pose p;
      p.t_ns = recording.t_ns[i];
      const auto t = turbomap::inverse(turbomap::to_isometry<double>(c)) * T_cb.t;
      // (q_c)^-1 (q_b)^-1
      p.T_wb.qw = c.qw * b.qw - c.qx * b.qx - c.qy * b.qy - c.qz * b.qz;
      p.T_wb.qx = -c.qw * b.qx - c.qx * b.qw + c.qy * b.qz - c.qz * b.qy;
      p.T_wb.qy = -c.qw * b.qy - c.qy * b.qw + c.qz * b.qx - c.qx * b.qz;
      p.T_wb.qz = -c.qw * b.qz - c.qz * b.qw + c.qx * b.qy - c.qy * b.qx;
      p.T_wb.tx = t.x, p.T_wb.ty = t.y, p.T_wb.tz = t.z;
      poses.push_back(p);
    }
    turbomap::write_trajectory(arguments.trajectory, poses);
  }
  return o;
}

template <class Camera, class Policy>
outcome run_with(const turbomap::recording& recording, const Policy& policy, const arguments& arguments) {
  if (!arguments.check || recording.meta.snapshots.empty()) return replay<Camera>(recording, policy, arguments);
  checker<Camera, Policy> check(recording, policy);
  for (const std::int32_t iteration : recording.meta.snapshots)
    check.check(turbomap::read_snapshot(recording, arguments.recording, iteration), arguments);
  return check.result(arguments);
}

/// Throws bad_file for a recording that cannot be read.
template <class Policy>
outcome run(const Policy& policy, const arguments& arguments) {
  const turbomap::recording recording = turbomap::read_recording(arguments.recording);
  return recording.meta.is_fisheye() ? run_with<turbomap::kannala_brandt<float>>(recording, policy, arguments)
                                     : run_with<turbomap::pinhole<float>>(recording, policy, arguments);
}

}  // namespace turbomap_replay
