// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded culling of keyframes of one iteration: the state that it read, its counts and its decisions.

#include <array>
#include <cstdint>
#include <vector>

#include <turbomap/config.hpp>
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// What became of a keyframe that was looked at.
enum class recorded_culling : std::uint8_t { kept = 0, culled = 1, first = 2, dead = 3 };

/// The lists are the peer's own, raw: a point may sit in slots of a keyframe that does not observe it, or not with that
/// keypoint, and may be observed by keyframes that are no longer in the map. They need not make a consistent map.
struct culling_snapshot {
  std::vector<std::int32_t> keyframe;                   ///< candidates in the order visited
  std::vector<index_pair> previous_next;                ///< in time, -1: none; one row a candidate
  std::vector<std::int64_t> slot_off;                   ///< rows of the slots; live points only
  std::vector<std::int32_t> slot_keypoint, slot_point;  ///< keypoint of the candidate; row of the points below

  std::vector<std::int32_t> point, observation_count;      ///< the peer's id; an observation with u_right counts 2
  std::vector<std::array<std::int32_t, 8>> octave_counts;  ///< the published counters: may drift, even below 0
  std::vector<std::int64_t> obs_off;                       ///< rows of the observations
  std::vector<std::int32_t> obs_kf;
  std::vector<index_pair> obs_keypoints;  ///< left and right, -1: none
  std::vector<std::uint8_t> obs_octave;   ///< the finer one of both

  std::vector<std::int32_t> dry_points, dry_redundant;  ///< on the unchanged state; -1: the map's first keyframe
  std::vector<std::int32_t> dry_redundant_published;    ///< by the published counters
  std::vector<std::int32_t> points, redundant;  ///< one after the other, each removal taking effect; -1: not counted
  std::vector<recorded_culling> status;

  float redundant_share = 0.9F;  ///< a keyframe is redundant above this share of its points
  bool inertial = false;         ///< the guards of inertial systems are on
  bool imu_initialized = false;
  std::int32_t last_guarded_id = 0;  ///< the peer's id of the 21st predecessor
  std::int32_t keyframes_left = 0;   ///< in the map, afterwards

  /// Rows of the slots of candidate i, and of the observations of point i.
  row_range slots(std::size_t i) const { return offset_rows(slot_off, i); }
  row_range observations(std::size_t i) const { return offset_rows(obs_off, i); }
};

template <>
struct npy_row<recorded_culling> {
  using scalar = std::uint8_t;
  static constexpr std::size_t columns = 1;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void read_culling_lists(const snapshot_source& from, culling_snapshot& out) {
  from.read("cull_in_kf", out.keyframe);
  const std::size_t n = out.keyframe.size();
  from.check.in_range("cull_in_kf", out.keyframe, 0, from.keyframe_count());
  from.read("cull_kf_prevnext", out.previous_next, n);
  for (std::size_t i = 0; i < n; ++i)
    for (const std::int32_t k : out.previous_next[i])
      if (k < -1 || k >= from.keyframe_count())
        from.check.fail_row("cull_kf_prevnext", i, "names " + std::to_string(k) + ", which is no keyframe");
  from.read("cull_pt_id", out.point);
  const std::size_t points = out.point.size();
  from.read("cull_pt_nobs", out.observation_count, points);
  from.read("cull_pt_scalecount", out.octave_counts, points);
  from.check.in_range("cull_pt_id", out.point, 0, std::int64_t{1} << 31);
  from.check.in_range("cull_pt_nobs", out.observation_count, 0, std::int64_t{1} << 31);

  from.read("cull_kf_kp", out.slot_keypoint);
  from.read("cull_kf_pt", out.slot_point, out.slot_keypoint.size());
  from.read_offsets("cull_kf_off", out.slot_off, n, out.slot_keypoint.size());
  from.check.in_range("cull_kf_pt", out.slot_point, 0, static_cast<std::int64_t>(points));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t row = out.slots(i).begin; row < out.slots(i).end; ++row)
      from.keypoint("cull_kf_kp", row, out.slot_keypoint[row], out.keyframe[i], false);

  from.read("cull_obs_kf", out.obs_kf);
  from.read("cull_obs_lr", out.obs_keypoints, out.obs_kf.size());
  from.read("cull_obs_octave", out.obs_octave, out.obs_kf.size());
  from.read_offsets("cull_obs_off", out.obs_off, points, out.obs_kf.size());
  from.check.in_range("cull_obs_kf", out.obs_kf, 0, from.keyframe_count());
  from.check.in_range("cull_obs_octave", out.obs_octave, 0, from.recording.meta.levels);
  from.views("cull_obs_lr", out.obs_keypoints, out.obs_kf);
}

inline void read_culling_results(const snapshot_source& from, culling_snapshot& out) {
  const std::size_t n = out.keyframe.size();
  const std::int64_t slots = static_cast<std::int64_t>(out.slot_keypoint.size());
  const auto counts = [&](const char* name, std::vector<std::int32_t>& values) {
    from.read(name, values, n);
    from.check.in_range(name, values, -1, slots + 1);
  };
  counts("cull_dry_nmps", out.dry_points);
  counts("cull_dry_nred", out.dry_redundant);
  counts("cull_dry_nred_opt", out.dry_redundant_published);
  std::vector<std::int32_t> visited;
  from.read("cull_kf", visited, n);
  for (std::size_t i = 0; i < n; ++i)
    if (visited[i] != out.keyframe[i]) from.check.fail_row("cull_kf", i, "is not the keyframe of cull_in_kf");
  counts("cull_nmps", out.points);
  counts("cull_nred", out.redundant);
  from.read("cull_status", out.status, n);
  for (std::size_t i = 0; i < n; ++i)
    if (out.status[i] > recorded_culling::dead)
      from.check.fail_row("cull_status", i, "is " + std::to_string(static_cast<int>(out.status[i])) + ", not 0 to 3");
}

inline void read_culling_meta(const json_reader& meta, culling_snapshot& out) {
  out.redundant_share = meta.get<float>("cull_redundant_th");
  out.inertial = meta.get<int>("inertial_run") != 0, out.imu_initialized = meta.get<int>("imu_initialized") != 0;
  out.last_guarded_id = meta.get<std::int32_t>("cull_last_id_kf_mnId");
  out.keyframes_left = meta.get<std::int32_t>("cull_keyframes_in_map");
  if (!(out.redundant_share > 0 && out.redundant_share <= 1)) meta.fail("cull_redundant_th", "is not in (0, 1]");
}

inline void read_culling(const snapshot_source& from, const json_reader& meta, culling_snapshot& out) {
  read_culling_meta(meta, out);
  read_culling_lists(from, out);
  read_culling_results(from, out);
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
