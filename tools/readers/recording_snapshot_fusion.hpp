// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The recorded search for duplicates of one iteration, and what was done with each.

#include <cstdint>
#include <string>
#include <vector>

#include <turbomap/config.hpp>
#include "recording_snapshot_source.hpp"

namespace turbomap {

/// Map points as the search for duplicates saw them: one row a state. A point has a new row after it changed.
struct recorded_states {
  std::vector<vec3<float>> position, normal;      ///< world, m; mean of the unit rays to the point
  std::vector<float> min_distance, max_distance;  ///< m; already 0.8 and 1.2 times the range's ends
  std::vector<float> raw_max_distance;            ///< m; the range's end itself, which predicts the octave
  std::vector<descriptor_bytes> descriptor;
  std::vector<std::int32_t> point;  ///< the peer's id
};

/// What a search of one point in one camera of one keyframe gave.
struct recorded_trials {
  std::vector<std::uint8_t> code;      ///< 0 matched, 1 too different, 2 dead point, 3 already seen, 4.. why rejected
  std::vector<std::int32_t> keypoint;  ///< the best one when code <= 1, else -1
  std::vector<std::int32_t> distance;  ///< its distance, else 256
  std::vector<std::int8_t> level;      ///< predicted octave, -1 when rejected before
};

/// The peer's way: a search a keyframe and camera, each match carried out before the next point is looked at.
struct recorded_calls {
  std::vector<std::int32_t> keyframe;  ///< one row per call
  std::vector<std::uint8_t> right;     ///< 1: in the right camera
  std::vector<std::uint8_t> backward;  ///< 0: the current keyframe's points in a target; 1: the targets' points in it
  std::vector<std::int64_t> off;       ///< rows of the entries
  std::vector<std::int32_t> state;     ///< one row per entry; -1: a dead point of which nothing is known
  recorded_trials found;
  std::vector<std::uint8_t> action;  ///< 0 none, 1 observation added, 2 candidate replaced, 3 it replaced, 4 point dead
  std::vector<std::int32_t> observations;       ///< the candidate's observation count before
  std::vector<std::int32_t> slot_observations;  ///< that of the keypoint's own point, -1: it has none
  std::vector<std::int32_t> slot_point;         ///< id of the keypoint's own point, -1: none
};

/// All points against all targets on one state: `found` is [targets][cameras][points].
struct recorded_batch {
  std::vector<std::int32_t> state;  ///< one row per point
  recorded_trials found;
};

struct fusion_snapshot {
  recorded_states states;
  std::vector<std::int32_t> targets;  ///< keyframe indices in order
  recorded_calls calls;
  std::vector<std::int32_t> forward_keypoint;  ///< the current keyframe's keypoint of each forward point
  recorded_batch forward;   ///< the current keyframe's points against the targets, on the state of the start
  recorded_batch backward;  ///< the targets' points against the current keyframe, after the forward calls
  std::size_t cameras = 1;
};

}  // namespace turbomap

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

inline void read_recorded_states(const snapshot_source& from, recorded_states& out) {
  from.read_finite("fs_pos", out.position);
  const std::size_t n = out.position.size();
  from.read_finite("fs_normal", out.normal, n);
  from.read_finite("fs_mindist", out.min_distance, n);
  from.read_finite("fs_maxdist", out.max_distance, n);
  from.read_finite("fs_rawmax", out.raw_max_distance, n);
  from.read("fs_desc", out.descriptor, n);
  from.read("fs_pt", out.point, n);
  from.check.in_range("fs_pt", out.point, 0, std::int64_t{1} << 31);
}

/// \param keyframe  of entry i
template <class KeyframeOf>
void read_trials(const snapshot_source& from, const std::string& prefix, const std::vector<std::size_t>& shape,
                 KeyframeOf keyframe, recorded_trials& out) {
  const std::string code = prefix + "code", keypoint = prefix + "bestidx", distance = prefix + "bestdist",
                    level = prefix + "level";
  from.read_shape(code.c_str(), out.code, shape);
  from.read_shape(keypoint.c_str(), out.keypoint, shape);
  from.read_shape(distance.c_str(), out.distance, shape);
  from.read_shape(level.c_str(), out.level, shape);
  from.check.in_range(code.c_str(), out.code, 0, 10);
  from.check.in_range(distance.c_str(), out.distance, 0, 257);
  from.check.in_range(level.c_str(), out.level, -1, from.recording.meta.levels);
  for (std::size_t i = 0; i < out.code.size(); ++i) {
    from.keypoint(keypoint.c_str(), i, out.keypoint[i], keyframe(i), out.code[i] > 1);
    if (out.code[i] > 1 && out.keypoint[i] != -1)
      from.check.fail_row(keypoint.c_str(), i, "is a keypoint, but the code says that none was found");
  }
}

inline void read_calls(const snapshot_source& from, const fusion_snapshot& s, recorded_calls& out) {
  from.read("fuse_call_kf", out.keyframe);
  const std::size_t calls = out.keyframe.size();
  from.read("fuse_call_right", out.right, calls);
  from.read("fuse_call_dir", out.backward, calls);
  from.read("fuse_e_state", out.state);
  const std::size_t n = out.state.size();
  from.read_offsets("fuse_call_off", out.off, calls, n);
  from.posed("fuse_call_kf", out.keyframe);
  from.check.in_range("fuse_call_right", out.right, 0, static_cast<std::int64_t>(s.cameras));
  from.check.in_range("fuse_call_dir", out.backward, 0, 2);
  from.check.in_range("fuse_e_state", out.state, -1, static_cast<std::int64_t>(s.states.point.size()));
  std::size_t call = 0;
  const auto keyframe = [&](std::size_t entry) {  // entries ascend
    while (entry >= static_cast<std::size_t>(out.off[call + 1])) ++call;
    return out.keyframe[call];
  };
  read_trials(from, "fuse_e_", {n}, keyframe, out.found);
  from.read("fuse_e_action", out.action, n);
  from.read("fuse_e_nobs", out.observations, n);
  from.read("fuse_e_inkf_nobs", out.slot_observations, n);
  from.read("fuse_e_inkf_pt", out.slot_point, n);
  from.check.in_range("fuse_e_action", out.action, 0, 5);
  from.check.in_range("fuse_e_inkf_pt", out.slot_point, -1, std::int64_t{1} << 31);
  for (std::size_t i = 0; i < n; ++i) {
    if (out.state[i] < 0 && out.found.code[i] != 2)
      from.check.fail_row("fuse_e_state", i, "is -1, but the code does not say that the point is dead");
    if ((out.action[i] != 0) != (out.found.code[i] == 0))
      from.check.fail_row("fuse_e_action", i, "does not fit the code: what is matched is acted upon, nothing else");
  }
}

inline void read_batch(const snapshot_source& from, const std::string& prefix, const fusion_snapshot& s,
                       const std::vector<std::int32_t>& keyframes, bool several, recorded_batch& out) {
  const std::string state = prefix + "state";
  from.read(state.c_str(), out.state);
  from.check.in_range(state.c_str(), out.state, 0, static_cast<std::int64_t>(s.states.point.size()));
  const std::size_t n = out.state.size();
  const std::vector<std::size_t> shape =
      several ? std::vector<std::size_t>{keyframes.size(), s.cameras, n} : std::vector<std::size_t>{s.cameras, n};
  read_trials(
      from, prefix, shape, [&](std::size_t i) { return keyframes[i / (s.cameras * n)]; }, out.found);
}

inline void read_fusion(const snapshot_source& from, std::int32_t keyframe, fusion_snapshot& out) {
  out.cameras = from.camera_count();
  read_recorded_states(from, out.states);
  from.read("fuse_targets", out.targets);
  from.posed("fuse_targets", out.targets);
  read_calls(from, out, out.calls);
  read_batch(from, "fuseb_fwd_", out, out.targets, true, out.forward);
  from.read("fuseb_fwd_kp", out.forward_keypoint, out.forward.state.size());
  from.check.in_range("fuseb_fwd_kp", out.forward_keypoint, 0, from.keypoint_count(keyframe));
  read_batch(from, "fuseb_bwd_", out, {keyframe}, false, out.backward);
}

}  // namespace detail

TURBOMAP_END_NAMESPACE
